"""Files of episodes: exact round trips, truncation and damage."""

import errno
import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from s2c2a.episodes import Episode, EpisodeWriter, blocks, load_episodes, save_episodes
from s2c2a.episodes import file as episode_file
from s2c2a.errors import DamagedRecordingError, RecordingError

from marks import slow_after

STEPS = 4
OPTIONS = {"seed": 3, "speeds": [0.03, 0.22], "no": None, "nested": {"a": [1, "zwei"]}}


def random_episode(arm, seed=0, steps=STEPS):
    """Numbers of the right shapes."""
    random = np.random.default_rng(seed)
    cables = (steps, arm.module_count, arm.cable_count)
    columns = {
        "time": np.cumsum(random.uniform(0.1, 0.2, steps)),
        "actions": random.normal(size=cables),
        "sensor.cables": random.normal(size=cables),
        "sensor.flex": random.normal(size=(steps, 2)).astype(np.float32),
        "stage": random.integers(0, 6, steps).astype(np.int8),
    }
    return Episode(arm, columns, {"number": seed})


def assert_same(one, other):
    """Two episodes agree in every bit, and in what is said of them."""
    assert (one.arm, one.options) == (other.arm, other.options)
    assert set(one.columns) == set(other.columns)
    for name, values in one.columns.items():
        assert values.dtype == other[name].dtype
        assert values.shape == other[name].shape
        assert values.tobytes() == other[name].tobytes()


@pytest.fixture
def three(twin):
    """Three episodes."""
    return [random_episode(twin, seed) for seed in range(3)]


@pytest.fixture
def grown(twin, tmp_path, three):
    """Where a file lies that grew to three episodes."""
    path = tmp_path / "grown.episodes"
    writer = EpisodeWriter.create(path, twin, OPTIONS)
    for episode in three:
        writer.append(episode)
    writer.close()
    return path


def test_episodes_survive_a_file_bit_for_bit_at_once_and_one_by_one(grown, three):
    at_once = save_episodes(three, grown.with_name("three.episodes"), OPTIONS)
    for path in (at_once, grown):
        found, options = load_episodes(path)
        assert options == OPTIONS
        for one, other in zip(found, three, strict=True):
            assert_same(one, other)
            assert list(one.columns) == sorted(one.columns)


KINDS = "f8 f4 f2 i8 i4 i2 i1 u8 u4 u2 u1 ? >f8 >i4"
NUMBERS = st.sampled_from(KINDS.split()).flatmap(
    lambda kind: hnp.arrays(np.dtype(kind), (STEPS, 3))
)


@settings(deadline=None, max_examples=40, suppress_health_check=list(HealthCheck))
@given(NUMBERS)
def test_values_of_every_type_survive_a_file(twin, tmp_path, values):
    """NaN, infinities, subnormal numbers, the largest integers, both byte orders."""
    columns = {"time": np.arange(STEPS) * 0.1, "actions": np.zeros((STEPS, 3, 3))}
    episode = Episode(twin, columns | {"sensor.own": values})
    save_episodes([episode], tmp_path / "one.episodes")
    found = load_episodes(tmp_path / "one.episodes")[0][0].sensor("own")
    assert found.dtype == values.dtype.newbyteorder("=")
    assert found.tobytes() == values.astype(found.dtype).tobytes()


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), {"deep": [float("-inf")]}, "\udc80", {(1, 2): 3}],
)
def test_options_that_cannot_be_kept_are_rejected_before_writing(twin, tmp_path, value):
    episode = random_episode(twin).with_options(value=value)
    with pytest.raises(RecordingError, match=r"options .* cannot be kept"):
        save_episodes([episode], tmp_path / "one.episodes")
    with pytest.raises(RecordingError, match=r"options .* cannot be kept"):
        EpisodeWriter.create(tmp_path / "one.episodes", twin, {"value": value})
    assert list(tmp_path.iterdir()) == []


def test_no_episode_and_episodes_of_different_arms_are_refused(
    twin, simulated, tmp_path
):
    for episodes in ([], [random_episode(twin), random_episode(simulated)]):
        with pytest.raises(RecordingError, match="at least one, all of the same arm"):
            save_episodes(episodes, tmp_path / "one.episodes")


def test_an_episode_of_another_arm_is_not_added(grown, simulated):
    before = grown.read_bytes()
    writer = EpisodeWriter(grown)
    with pytest.raises(RecordingError, match=r"'simulated_arm' does not belong"):
        writer.append(random_episode(simulated))
    writer.close()
    assert grown.read_bytes() == before


def last_block(path):
    """Where the last block begins."""
    return path.read_bytes().rindex(blocks.WORD)


@pytest.mark.parametrize("every", slow_after(1, [97, 1]))
def test_a_file_truncated_in_its_last_episode_can_be_continued(grown, three, every):
    whole = grown.read_bytes()
    for end in range(last_block(grown), len(whole), every):
        grown.write_bytes(whole[:end])
        assert len(load_episodes(grown)[0]) == 2
        writer = EpisodeWriter(grown)
        assert writer.count == 2
        writer.append(three[2])
        writer.close()
        assert grown.read_bytes() == whole


def test_a_file_truncated_in_its_header_is_rejected(grown):
    whole = grown.read_bytes()
    beginning = whole.index(blocks.WORD, 1)
    for end in range(beginning):
        grown.write_bytes(whole[:end])
        for read in (load_episodes, EpisodeWriter):
            with pytest.raises(DamagedRecordingError):
                read(grown)
    grown.write_bytes(whole[:beginning])
    with pytest.raises(RecordingError, match="holds no whole episode yet"):
        load_episodes(grown)


def test_a_truncated_file_with_a_known_count_is_rejected(tmp_path, three):
    path = save_episodes(three, tmp_path / "three.episodes")
    whole = path.read_bytes()
    for end in (last_block(path), last_block(path) + 5, len(whole) - 1):
        path.write_bytes(whole[:end])
        with pytest.raises(DamagedRecordingError, match="2 of 3 episodes are there"):
            load_episodes(path)


def starts_in(whole):
    """Where blocks begin."""
    return [at for at in range(len(whole)) if whole.startswith(blocks.WORD, at)]


def flips(path):
    """Sample byte positions: the starts of file and blocks, and some between."""
    whole = path.read_bytes()
    places = np.random.default_rng(0).integers(0, len(whole), 200)
    parts = [range(starts_in(whole)[1]), range(len(whole) - 20, len(whole))]
    parts += [range(at, at + blocks.START + 16) for at in starts_in(whole)]
    places = set(places.tolist()).union(*parts)
    return sorted(place for place in places if place < len(whole))


def flipped(whole, place, mask):
    """The bytes with one of them changed."""
    return whole[:place] + bytes([whole[place] ^ mask]) + whole[place + 1 :]


@pytest.mark.parametrize("mask", [0x01, 0x80, 0xFF])
def test_one_changed_byte_anywhere_is_detected(grown, mask):
    whole = grown.read_bytes()
    for place in flips(grown):
        grown.write_bytes(flipped(whole, place, mask))
        with pytest.raises(DamagedRecordingError):
            load_episodes(grown)


def test_moved_duplicated_and_removed_episodes_are_detected(grown):
    whole = grown.read_bytes()
    starts = [*starts_in(whole), len(whole)]
    head, *episodes = [whole[begin:end] for begin, end in pairwise(starts)]
    for order in ([1, 0, 2], [0, 0, 1, 2], [1, 2], [0, 2]):
        grown.write_bytes(head + b"".join(episodes[place] for place in order))
        with pytest.raises(DamagedRecordingError):
            load_episodes(grown)


def test_a_writer_rejects_a_file_damaged_before_its_last_episode(grown):
    whole, last = grown.read_bytes(), last_block(grown)
    for place in [place for place in flips(grown) if place < last]:
        damaged = flipped(whole, place, 0xFF)
        grown.write_bytes(damaged)
        with pytest.raises(DamagedRecordingError):
            EpisodeWriter(grown)
        assert grown.read_bytes() == damaged


def test_a_last_episode_of_zeros_is_skipped(grown, three):
    """The length had been written, the content had not."""
    whole, last = grown.read_bytes(), last_block(grown)
    content = last + blocks.START
    grown.write_bytes(whole[:content] + bytes(len(whole) - content))
    with pytest.raises(DamagedRecordingError):
        load_episodes(grown)
    writer = EpisodeWriter(grown)
    writer.append(three[2])
    writer.close()
    assert grown.read_bytes() == whole


@pytest.mark.parametrize("more", [b"\0", b"S", b"S2C2", b"more and more", bytes(1000)])
def test_data_behind_the_last_episode_is_detected(tmp_path, three, more):
    path = save_episodes(three, tmp_path / "three.episodes")
    path.write_bytes(path.read_bytes() + more)
    try:
        assert len(load_episodes(path)[0]) == 3
    except DamagedRecordingError:
        return
    assert blocks.WORD.startswith(more)


def test_a_second_writer_is_rejected(grown, twin):
    writer = EpisodeWriter(grown)
    with pytest.raises(RecordingError, match="in use by another process"):
        EpisodeWriter(grown)
    with pytest.raises(RecordingError, match="in use by another process"):
        EpisodeWriter.create(grown, twin, {})
    writer.close()
    writer.close()
    EpisodeWriter(grown).close()


def test_each_episode_is_in_the_file_as_soon_as_it_is_added(twin, tmp_path, three):
    path = tmp_path / "growing.episodes"
    writer = EpisodeWriter.create(path, twin, {})
    for count, episode in enumerate(three, 1):
        writer.append(episode)
        assert len(load_episodes(path)[0]) == writer.count == count
    writer.close()


def test_a_full_disk_leaves_earlier_episodes_intact(grown, three, monkeypatch):
    whole, write = grown.read_bytes(), episode_file.write_block

    def full(file, content, before):
        file.write(b"S2C2A\n half of it")
        raise OSError(errno.ENOSPC, "No space left on device")

    writer = EpisodeWriter(grown)
    monkeypatch.setattr(episode_file, "write_block", full)
    with pytest.raises(RecordingError, match="3 whole ones are kept: make room"):
        writer.append(three[0])
    assert grown.read_bytes() == whole
    monkeypatch.setattr(episode_file, "write_block", write)
    writer.append(three[0])
    writer.close()
    assert len(load_episodes(grown)[0]) == 4


@pytest.mark.parametrize(
    "content", [b"", b"S2C2A", b"name = 'arm'", bytes(5000), b"\x89HDF\r\n\x1a\n"]
)
def test_a_file_of_another_kind_is_refused(tmp_path, content):
    (tmp_path / "other").write_bytes(content)
    for read in (load_episodes, EpisodeWriter):
        with pytest.raises(DamagedRecordingError, match="no file of episodes"):
            read(tmp_path / "other")


def written(path, *contents):
    """A file of blocks of some contents, each sound in itself."""
    with open(path, "wb") as file:
        before = b""
        for content in contents:
            before = blocks.write_block(file, content, before)


HEAD = {"schema": 2, "arm": "", "options": {}, "count": None}
NO_ARM = {name: value for name, value in HEAD.items() if name != "arm"}
HEADS = {
    "no JSON": b"\xff\xfe",
    "another schema": json.dumps(HEAD | {"schema": 99}).encode(),
    "no arm": json.dumps(NO_ARM).encode(),
    "an arm that is none": json.dumps(HEAD | {"arm": "name = "}).encode(),
    "a list": b"[]",
    "deep": b"[" * 100_000,
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_an_invalid_header_with_a_valid_checksum_is_rejected(tmp_path, head):
    written(tmp_path / "odd.episodes", head)
    with pytest.raises(DamagedRecordingError):
        load_episodes(tmp_path / "odd.episodes")


def packed(data=b"", options=None, **time):
    """Content in the safetensors format, by hand."""
    header = {} if options is None else {"__metadata__": {"options": options}}
    words = json.dumps(header | ({"time": time} if time else {})).encode()
    return len(words).to_bytes(8, "little") + words + data


EPISODES = {
    "nothing": b"",
    "no safetensors": b"\xff" * 40,
    "no options": packed(dtype="F64", shape=[0], data_offsets=[0, 0]),
    "options that are no JSON": packed(options="{"),
    "no columns": packed(options="{}"),
    "more numbers than there are": packed(
        options="{}", dtype="F64", shape=[10**12], data_offsets=[0, 8 * 10**12]
    ),
    "numbers of an unknown kind": packed(
        bytes(2), "{}", dtype="BF16", shape=[1], data_offsets=[0, 2]
    ),
}


@pytest.mark.parametrize("content", EPISODES.values(), ids=EPISODES)
def test_an_invalid_episode_with_a_valid_checksum_is_rejected(twin, tmp_path, content):
    path = tmp_path / "odd.episodes"
    written(path, episode_file._pack_header(twin, {}, None), content)
    with pytest.raises(DamagedRecordingError):
        load_episodes(path)
