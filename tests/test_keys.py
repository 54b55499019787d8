"""The declaration of the keys: it is of all of a scenario's values, and help, parsing and checks come from it."""

import json
import pickle
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import pytest
from click.testing import CliRunner
from pivoting.models import ModelError, load, scene_path
from pivoting.models.scenes import WORLD_KEYS
from pivoting.sim import SCENARIOS, Limits, Scenario, own_object, simulate
from pivoting.sim.console.command_line import cli
from pivoting.sim.console.scenario_tables import key_help
from pivoting.sim.scenarios.key_declaration import Needs, declared_keys, described, documented, key
from pivoting.sim.scenarios.scenario_keys import CONTROL_KEYS, HIDDEN_KEYS, KEYS, SCENE_KEYS

OTHERS = {"name", "summary", "scene", "body", "support", "contact", "chosen", "about", "world", "limits", "given"}
ALL = [(cls, name) for cls in (Scenario, Limits) for name, each in declared_keys(cls).items() if each.limits]


def test_every_value_of_a_scenario_is_declared_once() -> None:
    assert {each.name for each in fields(Scenario)} - OTHERS == set(KEYS) == set(declared_keys(Scenario))
    assert set(declared_keys(Limits)) == {each.name for each in fields(Limits)}
    for cls in (Scenario, Limits):
        defaults = {each.name: each.default for each in fields(cls)}
        for name, each in declared_keys(cls).items():
            assert each.help, name
            assert each.default is defaults[name], name
            assert (each.words is not None) != bool(each.limits), name
            each.check(name, each.default)


def test_what_changes_a_scene_is_what_models_can_change() -> None:
    """Each key of the object and the simulator, but com, which stands for three of them, is a change of the scene."""
    assert set(SCENE_KEYS) == set(WORLD_KEYS)
    changing = {key for key in KEYS if KEYS[key].group in (KEYS["mu"].group, KEYS["dt"].group)}
    assert changing - {"com"} == set(WORLD_KEYS)
    with pytest.raises(ModelError, match=r"^theta = 3.0: of a scene only dt, impratio, .* can be changed"):
        load(scene_path("pivot-2d"), {"theta": 3.0})


@pytest.mark.parametrize(("cls", "name"), ALL)
def test_every_range_is_checked_at_its_ends(cls: type, name: str) -> None:
    key = declared_keys(cls)[name]
    for bound, value in key.limits.items():
        beyond = value - 1e-9 * max(abs(value), 1.0) if bound in ("above", "at_least") else value * (1.0 + 1e-9) + 1e-9
        for wrong in {beyond, value} if bound in ("above", "below") else {beyond}:
            with pytest.raises(ValueError, match=f"^{name} = "):
                key.check(name, wrong)
        if bound in ("at_least", "at_most"):
            key.check(name, value)


def test_text_is_read() -> None:
    assert KEYS["mu"].read("mu", "0.3") == 0.3
    assert KEYS["plan_steps"].read("plan_steps", "7") == 7
    assert isinstance(KEYS["plan_steps"].read("plan_steps", "7"), int)
    assert KEYS["law"].read("law", "static") == "static"
    with pytest.raises(ValueError, match=r"^world.mu = 'x': must be a number, or an interval LOW:HIGH$"):
        KEYS["mu"].read("world.mu", "x")
    assert type(Limits().change({"contacts_end": "4"}).contacts_end) is int
    with pytest.raises(ValueError, match=r"^limits.contacts_end = 1.5: must be a whole number"):
        Limits().change({"contacts_end": "1.5"})


def test_help_has_every_key_with_what_it_may_be() -> None:
    rows = {name: text for _, section in key_help() for name, text in section}
    assert set(rows) == {*KEYS, *declared_keys(Limits)}
    assert "> 0 and <= 10, or LOW:HIGH; default: as the scene has it" in rows["mu"]
    assert "> 0 N, or 2w; default: none" in rows["force_max"]
    assert "static, quasi-dynamic, quasi-dynamic-velocity, dynamic; default: dynamic" in rows["law"]
    assert "[>= 0 and < 45 deg; default: 5; only if reference is sine]" in rows["amplitude"]
    assert "; default: 30]" in rows["theta"]  # every reference has it
    assert "[>= 0 m; default: 0.0001]" in rows["slip_m"]
    for cls in (Scenario, Limits):
        told = " ".join((cls.__doc__ or "").split())
        for name in declared_keys(cls):
            assert f" {name}: {' '.join(rows[name].split())}" in told, name


@documented
@dataclass(frozen=True)
class Noisy(Scenario):
    """A scenario with keys of its own, each declared by its field and by nothing else."""

    blur: float | None = key(
        None,
        "blur of the angle",
        group="sensing",
        unit="deg",
        at_least=0.0,
        none="none",
        stage="pivoting.sim.pipeline.measurement_noise:MeasurementNoise",
    )
    taps: int = key(3, "taps of a filter", group="sensing", at_least=1, needs=Needs("blur"))
    force_floor: float | str = key(1.0, "a force", group="the controller", unit="N", above=0.0, relative="w")


def noisy(**changes: Any) -> Scenario:
    case = SCENARIOS["snap-2d"]
    values = {each.name: getattr(case, each.name) for each in fields(Scenario)}
    return Noisy(**values).change(**changes)


def test_a_new_key_needs_nothing_but_its_field() -> None:
    """It is read, checked, told in help and docstring, kept in the changes, resolved, and pickled."""
    case = noisy(blur="0.5", taps="5", force_floor="0.5w")
    assert isinstance(case, Noisy)
    assert (case.blur, case.taps, case.force_floor) == (0.5, 5, "0.5w")
    assert declared_keys(Noisy)["blur"].stages == ("pivoting.sim.pipeline.measurement_noise:MeasurementNoise",)
    rows = dict(dict(described(Noisy))["sensing"])
    assert rows["blur"] == "blur of the angle [>= 0 deg; default: none]"
    assert rows["taps"] == "taps of a filter [>= 1; default: 3; only if blur is set]"
    assert "blur: blur of the angle [>= 0 deg" in (Noisy.__doc__ or "")
    assert pickle.loads(pickle.dumps(case)) == case
    summary = simulate(case, seconds=0.2).summary()
    assert json.loads(json.dumps(summary["changes"])).items() >= {"blur": 0.5, "taps": 5, "force_floor": "0.5w"}.items()
    assert summary["resolved"]["force_floor"] == pytest.approx(5.0)
    for changes, message in (
        ({"blur": -1}, r"blur = -1.0: must be a finite number >= 0 \[deg\]"),
        ({"blur": "x"}, "blur = 'x': must be a number$"),
        ({"blur": 1, "taps": 2.5}, "taps = 2.5: must be a whole number"),
        ({"taps": 4}, "taps = 4: must be left out: it has no effect unless blur is set"),
        ({"noisy": 1}, "noisy = 1: must be a known key: .*, blur, taps, force_floor, world.mu"),
    ):
        with pytest.raises(ValueError, match=message):
            noisy(**changes)


def test_a_declaration_that_contradicts_its_type_is_refused() -> None:
    @dataclass(frozen=True)
    class Unsaid:
        value: float | None = key(None, "which says not what None means", group="", above=0.0)

    @dataclass(frozen=True)
    class Text:
        value: float | str = key(1.0, "which may be text, though of no kind", group="", above=0.0)

    for cls, message in ((Unsaid, "Unsaid.value: none="), (Text, "Text.value: text")):
        with pytest.raises(TypeError, match=message):
            declared_keys(cls)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("balance-2d", {"theta_end": 50}, "theta_end = 50: must be left out: .* unless reference is arc or return$"),
        (
            "balance-2d",
            {"hold": 0.1},
            "hold = 0.1: must be left out: it has no effect unless reference is arc or return",
        ),
        ("pivot-2d", {"amplitude": 1}, "amplitude = 1: must be left out: it has no effect unless reference is sine"),
        ("pivot-2d", {"reference": "sine", "theta_end": 50}, "theta_end = 50: must be left out"),
        ("pivot-2d", {"reference": lambda t: (t, t, t), "theta": 50}, "theta = 50: must be left out"),
        ("pivot-2d", {"plan_steps": 5}, "plan_steps = 5: must be left out: it has no effect unless plan_hz is set$"),
        ("pivot-2d", {"law": "static", "bandwidth": 9.0}, "bandwidth = 9.0: .* unless law is quasi-dynamic, quasi-dyn"),
        ("pivot-2d", {"law": "quasi-dynamic", "damping": 2.0}, "damping = 2.0: .* unless law is dynamic"),
    ],
)
def test_a_key_without_effect_is_refused(name: str, changes: Mapping[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SCENARIOS[name].change(**changes)


def test_what_has_an_effect_together_may_be_set_together() -> None:
    """In any order; and what was set before stays where it was, if it comes to have none."""
    assert SCENARIOS["balance-2d"].change(theta_end=50, reference="arc").theta_end == 50
    assert SCENARIOS["pivot-2d"].change(plan_steps=5, plan_hz=100).plan_steps == 5
    assert SCENARIOS["pivot-2d"].change(theta_end=50).change(reference="constant").theta_end == 50
    assert SCENARIOS["balance-2d"].change(seconds=3, theta=40, spread=1).seconds == 3


@pytest.mark.parametrize("setting", ["plan_step=0.01", "integrator=implicit", "track=1e6"])
def test_keys_of_a_plan_need_one(setting: str) -> None:
    """A run in open loop makes one; any other needs plan_hz, and the command line knows which it is."""
    words = ["run", "pivot-2d", "--set", "seconds=0.3", "--set", "hold=0.05", "--set", "theta_end=15", "--set", setting]
    wrong = CliRunner().invoke(cli, words, standalone_mode=False)
    assert re.fullmatch(
        r"\w+ = .*: must be left out: it has no effect unless plan_hz is set or the run is in open loop",
        str(wrong.exception),
    )
    done = CliRunner().invoke(cli, [*words, "--open-loop", "--json"], standalone_mode=False)
    assert done.exception is None, done.exception


def test_friction_that_mujoco_does_not_have_is_refused() -> None:
    """By the value that was given, of the world alone too."""
    for changes in ({"mu": 1e-6}, {"world.mu": 1e-6}):
        with pytest.raises(ModelError, match=r"^mu = 1e-06: must be > 1e-05, which is the least friction"):
            simulate("balance-2d", **changes)
    assert simulate("balance-2d", seconds=0.6, **{"world.mu": 1.1e-5}).world.mu == pytest.approx(1.1e-5)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1e300w", r"f_min = '1e300w': must be at most 1e\+12w$"),
        ("1e300", r"f_min = 1e\+300: must be a finite number >= 0 and <= 1e\+30 \[N\]"),
    ],
)
def test_a_floor_whose_square_is_not_finite_is_refused(value: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("balance-2d", f_min=value)


def test_what_was_set_is_kept_in_the_changes() -> None:
    """Also where it is the default, or is undone by what is set later."""
    case = SCENARIOS["incline-2d"]
    assert case.changes == {}
    assert case.change(mu="0.3").changes == {"mu": 0.3}  # which takes the world's 0.4 away
    assert case.change(theta=30).change(**{"world.mu": 0.4}).changes == {"theta": 30, "world.mu": 0.4}
    assert case.change(limits={"slip_m": "2e-5"}).changes == {"limit.slip_m": 2e-5}
    assert case.change(**{"world.mu": 0.2}).change(mu=0.25).changes == {"mu": 0.25}
    own = {"mu", "mass", "inertia", "com", "com_x", "com_y", "com_z", "size", "incline", "gravity"}
    assert set(HIDDEN_KEYS) == own
    assert set(CONTROL_KEYS) == {"law", "bandwidth", "damping", "margin", "guarantee", "f_min", "length"}


def test_a_scenario_of_ones_own_differs_from_the_defaults() -> None:
    case = Scenario("mine", "my own", "pivot-2d", theta=12.0)
    assert case.label == "mine theta=12.0"


def test_an_object_of_ones_own_is_known_by_its_file_whatever_the_scenario_is_called() -> None:
    case = replace(own_object("mug.xml", "mug"), name="mine")
    assert case.own
    assert case.changes == {}
    assert case.change(theta=2).label == "mine theta=2"
    assert not SCENARIOS["pivot-2d"].own
