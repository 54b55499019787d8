"""The declaration of the keys: it is of all of a scenario's values, and help, parsing and checks come from it."""

from dataclasses import fields

import pytest
from pivoting.models.scenes import WORLD_KEYS
from pivoting.sim import SCENARIOS, Scenario
from pivoting.sim.console.tables import key_help
from pivoting.sim.scenarios.scenario_keys import GROUPS, HIDDEN_KEYS, KEYS, OBJECT, SIMULATOR, check, parsed

OTHERS = {"name", "summary", "scene", "body", "support", "contact", "chosen", "about", "world", "limits", "given"}


def test_every_value_of_a_scenario_is_declared_once() -> None:
    names = {each.name for each in fields(Scenario)}
    assert names - OTHERS == set(KEYS)
    assert {name for name, key in KEYS.items() if key.of in (OBJECT, SIMULATOR)} == set(WORLD_KEYS)
    assert {key.of for key in KEYS.values()} == set(GROUPS)
    defaults = {each.name: each.default for each in fields(Scenario)}
    for name, key in KEYS.items():
        assert bool(key.optional) == (defaults[name] is None or name == "f_min"), name  # 0 in the shipped scenes
        assert bool(key.words) != bool(key.limits), name


@pytest.mark.parametrize("name", [name for name, key in KEYS.items() if key.limits])
def test_every_range_is_checked_at_its_ends(name: str) -> None:
    key = KEYS[name]
    for bound, value in key.limits.items():
        beyond = value - 1e-9 * max(abs(value), 1.0) if bound in ("above", "at_least") else value * (1.0 + 1e-9) + 1e-9
        for wrong in {beyond, value} if bound in ("above", "below") else {beyond}:
            with pytest.raises(ValueError, match=f"^{name} = "):
                check(name, wrong)
        if bound in ("at_least", "at_most"):
            check(name, value)


def test_text_is_read() -> None:
    assert parsed("mu", "0.3") == 0.3
    assert parsed("plan_steps", "7") == 7
    assert isinstance(parsed("plan_steps", "7"), int)
    assert parsed("law", "static") == "static"
    with pytest.raises(ValueError, match=r"^world.mu = 'x': must be a number$"):
        parsed("mu", "x", "world.")


def test_help_has_every_key_with_what_it_may_be() -> None:
    rows = {name: text for _, section in key_help() for name, text in section}
    assert set(KEYS) <= set(rows)
    assert "> 0 and <= 10; default: as the scene has it" in rows["mu"]
    assert "> 0 N, or 2w; default: none" in rows["force_max"]
    assert "static, quasi-dynamic, quasi-dynamic-velocity, dynamic; default: dynamic" in rows["law"]
    assert "slip_m" in rows


def test_what_was_set_is_kept_in_the_changes() -> None:
    """Also where it is the default, or is undone by what is set later."""
    case = SCENARIOS["incline-2d"]
    assert case.changes == {}
    assert case.change(mu="0.3").changes == {"mu": 0.3}  # which takes the world's 0.4 away
    assert case.change(theta=30).change(**{"world.mu": 0.4}).changes == {"theta": 30, "world.mu": 0.4}
    assert case.change(limits={"slip_m": "2e-5"}).changes == {"limit.slip_m": 2e-5}
    assert case.change(**{"world.mu": 0.2}).change(mu=0.25).changes == {"mu": 0.25}
    assert set(HIDDEN_KEYS) == {"mu", "mass", "size", "incline", "gravity"}


def test_a_scenario_of_ones_own_differs_from_the_defaults() -> None:
    case = Scenario("mine", "my own", "pivot-2d", theta=12.0)
    assert case.label == "mine theta=12.0"
