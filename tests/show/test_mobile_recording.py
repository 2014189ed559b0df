import re
from base64 import b64decode
from pathlib import Path

import numpy as np

from lic_drake.reach.environment import Environment
from lic_drake.reach.pointing_starts import pointing_starts, standing_at
from lic_drake.reach.scenario import load_scenario
from lic_drake.show.approach import WAITING_DEG
from lic_drake.show.mobile_recording import MobileRecording

BRIEF = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.4}}")
INSTANCE = BRIEF.sample_instance("training", 0)


class Watched(MobileRecording):
    """Notes everything that is drawn, with its time."""

    def _draw(self, b0: np.ndarray, q: np.ndarray) -> None:
        if not hasattr(self, "drawn"):
            self.drawn: list[tuple[float, np.ndarray, np.ndarray]] = []
        self.drawn.append((self._clock_s, b0.copy(), q.copy()))
        super()._draw(b0, q)


def test_base_torso_and_arm_move_in_that_order_and_the_arm_goes_back_as_it_came(
    tmp_path: Path,
) -> None:
    starts = pointing_starts(BRIEF, INSTANCE, standing_at(0.05, 0.2))
    b0, q, x0 = starts.grid.b0[7], starts.grid_angles[7], starts.grid.x0[7]
    p_WG = BRIEF.goals("training", 0)[4]
    environment = Environment(BRIEF, INSTANCE, p_WR=np.array([0.0, 0.05, 0.0]), torso_m=0.2)
    result = environment.reach(p_WG, x0, keep_states=True)
    assert result.outcome == "timeout"

    recording = Watched(BRIEF, INSTANCE)
    recording.move_to(b0, q)
    moves = [
        (not np.allclose(b[:2], a[:2]), not np.isclose(b[2], a[2]), not np.allclose(r, p))
        for (_, a, p), (_, b, r) in zip(recording.drawn, recording.drawn[1:], strict=False)
    ]
    order = list(dict.fromkeys(move for move in moves if any(move)))
    assert order == [(True, False, False), (False, True, False), (False, False, True)]
    np.testing.assert_allclose(recording.drawn[-1][1], [0.0, 0.05, 0.2])
    np.testing.assert_allclose(recording.drawn[-1][2], q)

    recording.add_reach(result.trace, p_WG, b0)
    np.testing.assert_allclose(recording.drawn[-1][2], result.trace.q[-1], atol=2e-2)
    count = len(recording.drawn)
    recording.retract(result.trace)
    np.testing.assert_allclose(recording.drawn[count][2], result.trace.q[-1])
    np.testing.assert_allclose(recording.drawn[-1][2], np.deg2rad(WAITING_DEG))
    times = [time for time, _, _ in recording.drawn]
    assert np.all(np.diff(times) >= 0.0)

    recording.save(tmp_path / "pr2.html")
    content = (tmp_path / "pr2.html").read_text(encoding="utf-8")
    messages = b"".join(b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", content))
    for name in (b"torso_lift_link", b"r_wrist_roll_link", b"object39", b"/task/goal"):
        assert name in messages
