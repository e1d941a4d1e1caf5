"""The notebook of the tour runs from top to bottom, and is stored without outputs."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

TOUR = Path(__file__).parents[2] / "examples" / "tour.ipynb"
LONGEST_CELL = 900  # s, on a busy machine


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    notebook = nbformat.read(TOUR, as_version=4)
    folder = tmp_path_factory.mktemp("tour")
    here = {"metadata": {"path": str(folder)}}
    options = {"timeout": LONGEST_CELL, "kernel_name": "python3", "resources": here}
    NotebookClient(notebook, **options).execute()
    return notebook, folder


def outputs_of(notebook) -> list:
    codes = [cell for cell in notebook.cells if cell.cell_type == "code"]
    return [output for cell in codes for output in cell.outputs]


@pytest.mark.slow
def test_networks_follow_the_circle_better_than_arcs(executed):
    notebook, _ = executed
    outputs = outputs_of(notebook)
    printed = [each.text for each in outputs if each.output_type == "stream"]
    errors = dict(re.findall(r"(\S+): ([\d.]+) cm from the circle", "".join(printed)))
    assert set(errors) == {"s2c2a", "pcc"}
    assert float(errors["s2c2a"]) < float(errors["pcc"])


@pytest.mark.slow
def test_figures_are_shown_in_the_notebook(executed):
    notebook, _ = executed
    kinds = [kind for each in outputs_of(notebook) for kind in each.get("data", {})]
    assert kinds.count("image/png") == 3


@pytest.mark.slow
def test_the_notebook_leaves_nothing_in_its_folder(executed):
    _, folder = executed
    assert list(folder.iterdir()) == []


def test_the_stored_notebook_is_valid_and_has_no_outputs():
    notebook = nbformat.read(TOUR, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert cells
    assert all(not cell.outputs and cell.execution_count is None for cell in cells)
