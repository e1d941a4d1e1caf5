"""The recording and the networks that tests read are what the tool would make."""

from tools import small_networks


def test_the_recording_is_the_one_that_is_described(recording):
    options = small_networks.COLLECTION
    assert len(recording.episodes) == options.episodes
    assert recording.lengths == (options.samples,) * options.episodes
    recording.check_complete()


def test_the_networks_are_of_the_recipes_that_tests_know(
    tiny_networks, tiny_best_networks
):
    assert tiny_networks.recipe == small_networks.PAPER_RECIPE
    assert tiny_best_networks.recipe == small_networks.BEST_RECIPE
    assert {tiny_networks.seed, tiny_best_networks.seed} == {small_networks.SEED}


def test_the_networks_are_of_the_arm_as_it_is(tiny_networks, tiny_best_networks, twin):
    for networks in (tiny_networks, tiny_best_networks):
        assert networks.arm == twin


def test_the_files_are_small():
    sizes = [path.stat().st_size for path in small_networks.FOLDER.iterdir()]
    assert sum(sizes) < 500_000
