"""Recordings on disk: round trips, what is not whole stays invisible, and damaged files are refused in words."""

import fcntl

import h5py
import numpy as np
import pytest

from s2c2a.data import load_recording
from s2c2a.data.recording import SCHEMA, RecordingWriter
from s2c2a.errors import DamagedRecordingError, RecordingError, S2C2AError

EPISODES, SAMPLES = 3, 7
OPTIONS = {"babbling": "motor", "episodes": EPISODES, "samples": SAMPLES, "seed": 2, "body": "none", "version": "0"}


def random_episode(arm, seed: int) -> dict[str, np.ndarray]:
    """Numbers of the right shapes."""
    cables = (arm.module_count, arm.cable_count)
    shapes = {"time": (), "actions": cables, "cables": cables}
    shapes |= {"states": (arm.module_count, 6), "configurations": (arm.module_count, 3)}
    random = np.random.default_rng(seed)
    return {name: random.normal(size=(SAMPLES, *shape)) for name, shape in shapes.items()}


@pytest.fixture
def written(twin, tmp_path):
    """Path of a recording with two of three episodes, and those episodes."""
    path, episodes = tmp_path / "two.h5", [random_episode(twin, seed) for seed in (0, 1)]
    writer = RecordingWriter.create(path, twin, OPTIONS)
    for episode in episodes:
        writer.append(episode)
    writer.close()
    return path, episodes


def test_what_was_written_is_read_back_bit_for_bit(written, twin):
    path, episodes = written
    loaded = load_recording(path)
    assert loaded.arm == twin
    assert loaded.options == OPTIONS
    for name in episodes[0]:
        np.testing.assert_array_equal(getattr(loaded, name), np.stack([episode[name] for episode in episodes]))


def test_options_come_back_as_plain_python_values(written):
    assert [type(value) for value in load_recording(written[0]).options.values()] == [
        type(value) for _, value in sorted(OPTIONS.items())
    ]


def test_every_array_has_its_unit_and_the_file_its_schema(written):
    with h5py.File(written[0]) as file:
        assert file.attrs["schema"] == SCHEMA
        units = {name: file[name].attrs["unit"] for name in ("time", "actions", "cables", "states", "configurations")}
    assert units == {
        "time": "s", "actions": "m or N", "cables": "m or N", "states": "m, 1", "configurations": "1"
    }  # fmt: skip


def test_an_episode_that_is_written_but_not_counted_is_invisible(written):
    path, episodes = written
    with h5py.File(path, "r+") as file:
        file["committed"][()] = 1
    loaded = load_recording(path)
    assert loaded.states.shape[0] == 1
    np.testing.assert_array_equal(loaded.states[0], episodes[0]["states"])


def test_a_recording_without_one_whole_episode_is_refused(twin, tmp_path):
    RecordingWriter.create(tmp_path / "empty.h5", twin, OPTIONS).close()
    with pytest.raises(RecordingError, match="no whole episode"):
        load_recording(tmp_path / "empty.h5")


def test_a_writer_goes_on_where_the_last_one_stopped(written, twin):
    path, _ = written
    third = random_episode(twin, 2)
    writer = RecordingWriter(path)
    assert writer.committed == 2
    writer.append(third)
    writer.close()
    np.testing.assert_array_equal(load_recording(path).actions[2], third["actions"])


def test_a_file_has_its_whole_size_from_the_beginning(twin, tmp_path):
    """So that adding an episode changes no structure that a kill could leave half changed."""
    path = tmp_path / "growing.h5"
    RecordingWriter.create(path, twin, OPTIONS).close()
    sizes = [path.stat().st_size]
    for seed in range(EPISODES):
        writer = RecordingWriter(path)
        writer.append(random_episode(twin, seed))
        writer.close()
        sizes.append(path.stat().st_size)
    assert sizes == sizes[:1] * (EPISODES + 1)


def test_each_episode_is_on_disk_as_soon_as_it_is_counted(twin, tmp_path):
    """Read from the bytes of the file while the writer still holds it."""
    writer = RecordingWriter.create(tmp_path / "open.h5", twin, OPTIONS)
    for count in (1, 2):
        writer.append(random_episode(twin, count))
        copy = tmp_path / f"copy_{count}.h5"
        copy.write_bytes((tmp_path / "open.h5").read_bytes())
        assert len(load_recording(copy).time) == count
    writer.close()


@pytest.mark.parametrize("part", [0.0, 0.001, 0.05, 0.2, 0.5, 0.8, 0.99, 0.9999])
def test_a_file_that_is_cut_off_is_refused(written, part):
    path, _ = written
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(DamagedRecordingError, match="cut off"):
        load_recording(path)
    with pytest.raises(DamagedRecordingError):
        RecordingWriter(path)


@pytest.mark.parametrize("content", [b"", b"name = 'arm'", bytes(5000), b"\x89HDF\r\n\x1a\n" + bytes(200)])
def test_a_file_of_another_kind_is_refused(tmp_path, content):
    (tmp_path / "other.h5").write_bytes(content)
    with pytest.raises(DamagedRecordingError, match="HDF5"):
        load_recording(tmp_path / "other.h5")


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "nothing.h5", tmp_path):
        with pytest.raises(RecordingError, match="no recording at"):
            load_recording(path)


def test_hdf5_of_another_schema_is_refused(written):
    path, _ = written
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = SCHEMA + 1
    with pytest.raises(DamagedRecordingError, match=rf"not a recording of schema {SCHEMA} \(schema {SCHEMA + 1}"):
        load_recording(path)


@pytest.mark.parametrize("name", ["committed", "states", "time"])
def test_hdf5_that_lacks_an_array_is_refused_and_the_array_named(written, name):
    path, _ = written
    with h5py.File(path, "r+") as file:
        del file[name]
    with pytest.raises(DamagedRecordingError, match=rf"missing \['{name}'\]"):
        load_recording(path)


def test_hdf5_without_an_arm_is_refused(written):
    path, _ = written
    with h5py.File(path, "r+") as file:
        del file.attrs["arm"]
    with pytest.raises(DamagedRecordingError, match=r"missing \['arm'\]"):
        load_recording(path)


@pytest.mark.parametrize("name", ["committed", "states"])
def test_hdf5_damaged_inside_is_refused(written, name):
    """The header of one array is overwritten; the file's ends are sound."""
    path, _ = written
    with h5py.File(path) as file:
        place = h5py.h5o.get_info(file[name].id).addr
    content = bytearray(path.read_bytes())
    content[place : place + 64] = b"\xff" * 64
    path.write_bytes(content)
    with pytest.raises(DamagedRecordingError, match="damaged"):
        load_recording(path)


@pytest.mark.parametrize("name", ["actions", "cables"])
def test_numbers_that_no_arm_could_have_sent_or_read_are_refused(written, name):
    path, _ = written
    with h5py.File(path, "r+") as file:
        file[name][1, 3, 2, 1] = np.nan
    with pytest.raises(DamagedRecordingError, match="not finite"):
        load_recording(path)


OVERSTATED = {
    "samples": lambda file: file.attrs.modify("option.samples", 99),
    "episodes": lambda file: file["committed"].write_direct(np.array(99)),
}


@pytest.mark.parametrize("overstate", OVERSTATED.values(), ids=OVERSTATED)
def test_a_file_that_says_it_holds_more_than_it_does_is_refused(written, overstate):
    path, _ = written
    with h5py.File(path, "r+") as file:
        overstate(file)
    with pytest.raises(DamagedRecordingError, match="wrong shape"):
        load_recording(path)


def test_a_file_that_another_program_writes_is_in_use_and_not_damaged(written):
    path, _ = written
    with path.open("rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(RecordingError, match="in use") as caught:
            load_recording(path)
    assert caught.type is RecordingError


def test_a_recording_cut_short_says_so_when_it_is_to_be_whole(written, twin):
    path, _ = written
    with pytest.raises(RecordingError, match="2 of 3 episodes"):
        load_recording(path).check_complete()
    writer = RecordingWriter(path)
    writer.append(random_episode(twin, 2))
    writer.close()
    load_recording(path).check_complete()


def test_a_recording_whose_arm_cannot_be_read_is_refused_by_name(written):
    path, _ = written
    with h5py.File(path, "r+") as file:
        file.attrs["arm"] = "name = "
    with pytest.raises(S2C2AError, match=r"arm in .*two\.h5"):
        load_recording(path)
