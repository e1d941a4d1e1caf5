"""Weight files and recipe files name the same class of the user's own alike."""

from dataclasses import asdict, replace

import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import UntrustedCodeError
from s2c2a.models.registry import MODELS
from s2c2a.plugins.discovery import trust_code, trust_of_one_command
from s2c2a.strategies import (
    load_networks,
    load_recipe,
    planning_as,
    save_networks,
    shipped_networks,
)

TEXT = """from dataclasses import dataclass

from s2c2a.models import LocalOptions


@dataclass(frozen=True)
class Mine(LocalOptions):
    pass
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A recipe file and a weight file with a forward model of the user's own."""
    tmp_path = tmp_path_factory.mktemp("own_classes")
    (tmp_path / "own_local_model.py").write_text(TEXT)
    recipe_file = tmp_path / "own.toml"
    c2s = asdict(shipped_networks(load_arm("twin_arm")).recipe.c2s)
    del c2s["model"]
    lines = [f"{key} = {str(value).lower()}" for key, value in c2s.items()]
    recipe_file.write_text(
        'based_on = "best"\n[c2s]\nmodel = "own_local_model.py:Mine"\n'
        + "\n".join(lines).replace("(", "[").replace(")", "]")
    )
    recipe = load_recipe(recipe_file)
    weights = tmp_path / "own.safetensors"
    networks = shipped_networks(load_arm("twin_arm"))
    save_networks(replace(networks, recipe=recipe), weights)
    return recipe, weights


def test_a_recipe_file_plans_with_weights_of_its_own_class(own):
    recipe, weights = own
    networks = load_networks(weights)
    assert networks.recipe.c2s.model == "own_local_model:Mine"
    assert planning_as(networks, recipe).recipe is recipe


@pytest.mark.parametrize("by", ["module", "file"])
def test_a_trusted_class_of_a_weight_file_is_imported(by, tmp_path, monkeypatch):
    name = f"trusted_by_{by}"
    (tmp_path / f"{name}.py").write_text(TEXT)
    monkeypatch.syspath_prepend(str(tmp_path))
    with trust_of_one_command():
        with pytest.raises(UntrustedCodeError, match=f"--trust {name}:Mine in"):
            MODELS.imported(f"{name}:Mine")
        trust_code(f"{name}:Mine" if by == "module" else f"{tmp_path / name}.py:Mine")
        assert MODELS.imported(f"{name}:Mine").__name__ == "Mine"
