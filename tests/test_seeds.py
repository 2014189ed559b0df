import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.errors import RequestError
from lic_drake.seeds import STREAMS, make_generator

ADDRESSES = st.tuples(
    st.sampled_from(STREAMS),
    st.text(max_size=8),
    st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 3)),
)


def draw(stream: str, purpose: str, indices: tuple[int, ...]) -> list[int]:
    return list(make_generator(stream, purpose, *indices).integers(0, 2**62, size=4))


@given(ADDRESSES, ADDRESSES)
def test_different_addresses_give_different_draws(
    a: tuple[str, str, tuple[int, int]], b: tuple[str, str, tuple[int, int]]
) -> None:
    assert draw(*a) == draw(*a)
    if a != b:
        assert draw(*a) != draw(*b)


def test_streams_purposes_and_neighbouring_indices_are_uncorrelated() -> None:
    addresses = [(s, p, (i,)) for s in STREAMS for p in ("goal", "clutter") for i in range(3)]
    samples = [make_generator(s, p, *i).standard_normal(4000) for s, p, i in addresses]
    correlation = np.corrcoef(samples) - np.eye(len(samples))
    # 4000 independent draws: standard deviation 0.016, 276 pairs.
    assert np.max(np.abs(correlation)) < 5.0 / np.sqrt(4000)


def test_the_mapping_from_address_to_numpy_seed_does_not_change() -> None:
    # Libraries keep only the stream's name and the index: another mapping would silently
    # replace their environments.
    expected = np.random.default_rng([1, zlib.crc32(b"cylinder-clutter"), 12]).random(5)
    np.testing.assert_array_equal(
        make_generator("evaluation", "cylinder-clutter", 12).random(5), expected
    )
    assert STREAMS == ("training", "evaluation", "calibration", "holdout", "imagination")


def test_an_unknown_stream_is_named_with_the_known_ones() -> None:
    with pytest.raises(RequestError, match=r"'test'.*training, evaluation, calibration, holdout"):
        make_generator("test", "goal", 0)


# NumPy would split an index of 2^32 into two words: the same draws as for the indices (0, 1).
@given(st.one_of(st.integers(max_value=-1), st.integers(min_value=2**32)))
def test_an_index_out_of_range_is_refused(index: int) -> None:
    with pytest.raises(RequestError, match=rf"0 to 2\^32 - 1, got \[3, {index}\]"):
        make_generator("training", "goal", 3, index)
