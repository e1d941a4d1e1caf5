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
    client = NotebookClient(
        notebook,
        timeout=LONGEST_CELL,
        kernel_name="python3",
        resources={"metadata": {"path": str(folder)}},
    )
    client.execute()
    return notebook, folder


def printed(notebook) -> str:
    return "".join(
        output.text
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "stream"
    )


@pytest.mark.slow
def test_networks_follow_the_circle_better_than_arcs(executed):
    notebook, _ = executed
    errors = dict(re.findall(r"(\S+): ([\d.]+) cm from the circle", printed(notebook)))
    assert set(errors) == {"s2c2a", "pcc"}
    assert float(errors["s2c2a"]) < float(errors["pcc"])


@pytest.mark.slow
def test_figures_are_shown_in_the_notebook(executed):
    notebook, _ = executed
    pictures = [
        output
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert len(pictures) == 3


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
