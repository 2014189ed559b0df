import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.errors import RequestError
from lic_drake.experience.shard import WHOLE, Shard


@given(st.integers(0, 100), st.integers(0, 60), st.integers(1, 20))
def test_the_shares_cover_every_environment_once_and_evenly(
    first: int, environments: int, count: int
) -> None:
    whole = range(first, first + environments)
    shares = [list(Shard(k, count).share(whole)) for k in range(1, count + 1)]
    assert sorted(index for share in shares for index in share) == list(whole)
    assert max(map(len, shares)) - min(map(len, shares)) <= 1
    assert list(WHOLE.share(whole)) == list(whole)


@given(st.integers(1, 20), st.integers(1, 10))
def test_more_environments_do_not_change_to_whom_the_others_belong(count: int, more: int) -> None:
    for k in range(1, count + 1):
        shard = Shard(k, count)
        few, many = set(shard.share(range(7, 17))), set(shard.share(range(7, 17 + more)))
        assert many & set(range(7, 17)) == few


@given(st.integers(1, 999), st.integers(0, 999))
def test_a_shard_comes_back_from_its_text(index: int, more: int) -> None:
    shard = Shard(index, index + more)
    assert Shard.parse(str(shard)) == shard


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "", "/", "-1/3", "1/0", "1/two", "1/3/5"])
def test_what_is_no_share_is_refused(text: str) -> None:
    with pytest.raises(RequestError, match="a shard is k/n with k from 1 to n"):
        Shard.parse(text)
