import doctest
import importlib
import inspect

import pytest

import pitchline

MODULES = ["", ".campaign", ".cmaes", ".doe", ".gear", ".kriging", ".plots", ".remote", ".results", ".simulate", ".stats"]


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(f"pitchline{name}"))
    assert found.failed == 0
    assert found.attempted > 0


@pytest.mark.parametrize("name", MODULES)
def test_everything_public_says_what_it_is(name):
    module = importlib.import_module(f"pitchline{name}")
    for public in module.__all__:
        thing = getattr(module, public)
        if not (inspect.isclass(thing) or inspect.isfunction(thing)):
            continue
        assert thing.__doc__, public
        for method, value in vars(thing).items():
            if not method.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                assert value.__doc__, f"{public}.{method}"


def test_what_is_not_there_is_named():
    with pytest.raises(AttributeError, match="'pitchline' has no attribute 'gears'"):
        pitchline.gears  # noqa: B018
    assert {"kriging", "Campaign"} <= set(dir(pitchline))
