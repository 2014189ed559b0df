"""Data sets of episodes in the layouts of others, written here by their formats' descriptions."""

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lic_drake.errors import LicError
from lic_drake.estimate.episodes import is_data_set, read_episodes
from lic_drake.estimate.rollouts import read_rollouts

EPISODES, FRAMES = 12, 5


@pytest.fixture
def states() -> np.ndarray:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (EPISODES, FRAMES, 3)).astype(np.float32)


@pytest.fixture
def won() -> np.ndarray:
    return np.arange(EPISODES) % 3 == 0


def frames(states: np.ndarray, won: np.ndarray, episodes: list[int]) -> pa.Table:
    """LeRobot's table of some episodes; one that succeeds does so in its middle."""
    success = [won[e] and f == FRAMES // 2 for e in episodes for f in range(FRAMES)]
    state = states[episodes].reshape(-1, 3)
    image = [{"bytes": b"png", "path": "a.png"}] * len(state)
    columns = {
        "observation.state": pa.FixedSizeListArray.from_arrays(state.ravel(), 3),
        "observation.image": image,
        "action": list(-state[:, :2]),
        "task": ["push"] * len(state),
        "episode_index": np.repeat(episodes, FRAMES),
        "frame_index": np.tile(np.arange(FRAMES), len(episodes)),
        "next.success": success,
    }
    return pa.table(columns)


def write_lerobot(folder: Path, files: dict[str, pa.Table]) -> Path:
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v3.0"}))
    for name, table in files.items():
        path = folder / "data" / "chunk-000" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, path)
    return folder


@pytest.mark.parametrize("one_file", [True, False])
def test_lerobot_data_is_a_row_for_each_episode(tmp_path, states, won, one_file):
    everything = list(range(EPISODES))
    parts = [everything] if one_file else [[e] for e in everything]
    name = "file-{:03d}.parquet" if one_file else "episode_{:06d}.parquet"
    files = {name.format(i): frames(states, won, part) for i, part in enumerate(parts)}
    folder = write_lerobot(tmp_path / "set", files)
    assert is_data_set(folder) and not is_data_set(tmp_path)
    table = read_episodes(folder)
    assert not {"observation.image", "task"} & set(table.column_names)
    order = table["episode_index"].to_numpy()
    np.testing.assert_array_equal(np.sort(order), everything)
    for i in range(3):
        np.testing.assert_array_equal(table[f"observation.state_{i}"], states[order, 0, i])
    np.testing.assert_array_equal(table["action_1"], -states[order, 0, 1])
    np.testing.assert_array_equal(table["success"], won[order])


def write_robomimic(path: Path, states: np.ndarray, won: np.ndarray, **left_out: bool) -> Path:
    with h5py.File(path, "w") as file:
        for e, state in enumerate(states):
            demo = file.create_group(f"data/demo_{e}")
            demo["actions"] = -state[:, :2]
            demo["obs/object"] = state
            demo["obs/agentview_image"] = np.zeros((FRAMES, 4, 4, 3), dtype=np.uint8)
            if "rewards" not in left_out:
                demo["rewards"] = np.eye(FRAMES)[-1] * won[e]
    return path


def test_a_file_of_robomimic_is_a_row_for_each_demonstration(tmp_path, states, won):
    table = read_episodes(write_robomimic(tmp_path / "rollouts.hdf5", states, won))
    np.testing.assert_array_equal(table["demo"], np.arange(EPISODES))
    np.testing.assert_array_equal(table["obs/object_2"], states[:, 0, 2])
    np.testing.assert_array_equal(table["actions_0"], -states[:, 0, 0])
    np.testing.assert_array_equal(table["success"], won)
    assert not any("image" in name for name in table.column_names)


def test_rollouts_are_read_from_either(tmp_path, states, won):
    folder = write_lerobot(
        tmp_path / "set", {"file-000.parquet": frames(states, won, [*range(12)])}
    )
    file = write_robomimic(tmp_path / "rollouts.hdf5", states, won)
    known = [
        read_rollouts(folder, given=["observation.state_0"], decide=["observation.state_1"]),
        read_rollouts(file, given=["obs/object_0"], decide=["obs/object_1"]),
    ]
    for rollouts in known:
        np.testing.assert_array_equal(rollouts.rows.X, states[:, 0, :2])
        np.testing.assert_array_equal(rollouts.rows.y, won)


def test_vectors_of_different_lengths_and_what_only_some_have_are_no_columns(tmp_path, states, won):
    path = write_robomimic(tmp_path / "rollouts.h5", states, won)
    with h5py.File(path, "a") as file:
        for e in range(EPISODES):
            file[f"data/demo_{e}/obs/seen"] = np.zeros((FRAMES, 1 + e % 2))
        file["data/demo_3/obs/seldom"] = np.zeros((FRAMES, 1))
    names = read_episodes(path).column_names
    assert "obs/object_0" in names and not any("se" in name.split("/")[-1] for name in names)


def test_what_is_missing_is_named(tmp_path, states, won):
    without = frames(states, won, [0, 1]).drop_columns(["next.success"])
    folder = write_lerobot(tmp_path / "set", {"file-000.parquet": without})
    with pytest.raises(LicError, match=r"no column next\.success; they have observation\.state"):
        read_episodes(folder)
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    pq.write_table(frames(states, won, [0, 1]).slice(1), path)
    with pytest.raises(LicError, match=r"1 episodes of .* have no frame 0"):
        read_episodes(folder)
    pq.write_table(frames(states, won, [0, 1]).slice(0, 0), path)
    with pytest.raises(LicError, match="has no episodes"):
        read_episodes(folder)
    path.write_bytes(b"no table")
    with pytest.raises(LicError, match="cannot read the frames of"):
        read_episodes(folder)
    file = write_robomimic(tmp_path / "rollouts.hdf5", states, won, rewards=False)
    with pytest.raises(LicError, match="with obs, actions and rewards"):
        read_episodes(file)
    with h5py.File(file, "a") as content:
        content["data/demo_3/obs/group/of"] = 1.0
    with pytest.raises(LicError, match="cannot read"):
        read_episodes(file)
    file.write_bytes(b"no file of HDF5")
    with pytest.raises(LicError, match="cannot read"):
        read_episodes(file)
    with pytest.raises(LicError, match="cannot read"):
        read_episodes(tmp_path / "none.hdf5")
