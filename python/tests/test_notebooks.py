from pathlib import Path

import nbclient
import nbformat
import pytest

NOTEBOOKS = Path(__file__).resolve().parents[2] / "docs" / "notebooks"


@pytest.mark.parametrize("file", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda file: file.stem)
def test_a_notebook_runs(file):
    notebook = nbformat.read(file, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": file.parent}})
    client.execute()
    # The diff of a notebook is readable if the notebook has no outputs.
    assert all(not cell.get("outputs") for cell in nbformat.read(file, as_version=4).cells)


def test_there_are_notebooks():
    assert len(list(NOTEBOOKS.glob("*.ipynb"))) == 5
