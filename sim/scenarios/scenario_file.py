"""A scenario as a JSON file: what `pivoting run` needs to run it again, and of a saved run what `load` needs.

    {"scenario": "pivot", "model": "mug.xml", "body": "mug", "contact": "vertex", "support": null, "as_modelled": false,
     "changes": {"theta_end": 30, "world.mu": 0.4, "limit.slip_m": 0.001},
     "worlds": 8, "seed": 1, "first_world": 0, "open_loop": false, "keep": "all"}

Only the first entry has to be there. A relative path counts from the file's folder. What is not a shipped scenario may
also have "summary" and "about", and the name of a shipped "scene" in place of a "model".
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from pivoting.controller.validate import InputError, one_of
from pivoting.sim.keep import KEEP
from pivoting.sim.scenarios.intervals import spelled
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import own_object, scenario, shipped

FORMAT = "pivoting 1"
_LIMIT = "limit."
_PLAIN = (str, int, float, np.integer, type(None))  # what JSON keeps to the last digit; float64 is a float
_OWN = {  # entries that say what is simulated, with what they may be
    "model": (str,),
    "scene": (str,),
    "body": (str,),
    "support": (str, type(None)),
    "contact": (str, list),
    "as_modelled": (bool,),
    "summary": (str,),
    "about": (str,),
}
_ENTRIES = {  # all entries, likewise
    "format": (str,),
    "scenario": (str,),
    **_OWN,
    "changes": (dict,),
    "worlds": (int,),
    "seed": (int,),
    "first_world": (int,),
    "open_loop": (bool,),
    "keep": (str,),
    "python_objects": (list,),
    "digest": (str,),
    "versions": (dict,),
    "arrays": (dict,),
}
_KINDS = {
    str: "text",
    type(None): "null",
    bool: "true or false",
    int: "a whole number",
    dict: "an object",
    list: "a list",
}


@dataclass(frozen=True)
class ScenarioFile:
    """What a scenario's file says.

    Attributes:
        case: the scenario; None if a Python object is part of it, which no file can hold.
        worlds, seed, first_world, open_loop, keep: arguments of `simulate`.
        python_objects: what else the run was made with that no file can hold: scenario, controller, control, observe.
        digest: of the run, see `recording_id.digest`.  versions: by package, with which it was made.
        arrays: of a saved run, "file", "bytes" and "blake2b" of its arrays.
    """

    case: Scenario | None
    worlds: int = 1
    seed: int = 0
    first_world: int = 0
    open_loop: bool = False
    keep: str = "all"
    python_objects: tuple[str, ...] = ()
    digest: str | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    arrays: Mapping[str, Any] | None = None

    @property
    def scenario(self) -> Scenario:
        """The scenario.

        Raises:
            ValueError: a Python object is part of it.
        """
        if self.case is None:
            raise InputError("scenario: was made with a Python object, which no file holds")
        return self.case


def written(file: ScenarioFile) -> dict[str, Any]:
    """What the file says, as `json.dumps` takes it; of a scenario that holds a Python object, that object's type."""
    said = _said(file.scenario)
    rest = {each.name: getattr(file, each.name) for each in fields(file) if each.name != "case"}
    rest["python_objects"] = list(file.python_objects)
    if file.keep == "all":  # as ever
        del rest["keep"]
    return {"format": FORMAT, **said, **{name: value for name, value in rest.items() if value is not None}}


def expressible(case: Scenario) -> bool:
    """Whether the scenario that is read from its file is this one in all that has an effect."""
    plain = all(isinstance(spelled(value), _PLAIN) for value in case.changes.values())
    if not plain or not isinstance(case.reference, str):
        return False
    try:
        again = _scenario(json.loads(json.dumps(_said(case))), Path())
    except ValueError:
        return False
    return all(own(again) == own(case) for own in (_said, _fixed, lambda each: each.world))


def read(path: Path) -> ScenarioFile:
    """What a scenario's file says.

    Raises:
        ValueError: there is no such file, or it is no scenario, or one of a later version; the file is named.
    """
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: must be a scenario in JSON, whole ({error})") from None
    try:
        return described(said, path.parent)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def described(said: Any, folder: Path) -> ScenarioFile:
    """What was said of a scenario in a file in this folder.

    Raises:
        ValueError: it is none, or one of a later version.
    """
    _check(said)
    case = None if "scenario" in said.get("python_objects", ()) else _scenario(said, folder)
    known = {each.name for each in fields(ScenarioFile)} & set(said)
    kept = {name: said[name] for name in known}
    return ScenarioFile(case, **{**kept, "python_objects": tuple(kept.get("python_objects", ()))})


def _check(said: Any) -> None:
    """Refuse what is not a scenario's file."""
    if not isinstance(said, dict) or "scenario" not in said:
        raise InputError('must be a JSON object such as {"scenario": "pivot-2d"}')
    if said.get("format", FORMAT) != FORMAT:
        raise InputError(f"format = {said['format']!r}: this version of pivoting reads {FORMAT!r}")
    for name, value in said.items():
        if name not in _ENTRIES:
            raise InputError(f"{name}: must be one of {', '.join(_ENTRIES)}")
        if type(value) not in _ENTRIES[name]:
            allowed = " or ".join(_KINDS[kind] for kind in _ENTRIES[name])
            raise InputError(f"{name} = {json.dumps(value)}: must be {allowed}")
    if not all(isinstance(name, str) for name in said.get("python_objects", ())):
        raise InputError(f"python_objects = {json.dumps(said['python_objects'])}: must be a list of names")
    one_of("keep", said.get("keep", "all"), tuple(KEEP))


def _scenario(said: Mapping[str, Any], folder: Path) -> Scenario:
    """The scenario of a file in this folder."""
    changes = {key: value for key, value in said.get("changes", {}).items() if not key.startswith(_LIMIT)}
    for key in {"world", "limits"} & set(changes):
        raise InputError(f"changes: {key} must be {'world.KEY' if key == 'world' else 'limit.KEY'}")
    limits = {key.removeprefix(_LIMIT): value for key, value in said.get("changes", {}).items() if key not in changes}
    return _unchanged(said, folder).change(**changes, limits=limits)


def _unchanged(said: Mapping[str, Any], folder: Path) -> Scenario:
    """The same before its changes."""
    name = said["scenario"]
    own = {key: said[key] for key in _OWN if key in said}
    if not own:
        return scenario(name)
    if ("model" in own) == ("scene" in own) or "body" not in own:
        raise InputError(
            f"{', '.join(own)}: must be a model, or a scene, and a body, or left out for a shipped scenario"
        )
    scene = own["scene"] if "scene" in own else folder / own["model"]
    body, contact = own["body"], own.get("contact", "lowest")
    fixed = {
        "name": name,
        "summary": own.get("summary", own_object(scene, body, contact).summary),
        "scene": scene,
        "body": body,
        "support": own.get("support"),
        "contact": contact,
        "chosen": not own.get("as_modelled", False),
        "about": own.get("about", "tilt"),
    }
    case = Scenario(**fixed)
    return replace(shipped(case) or case, **fixed)


def _said(case: Scenario) -> dict[str, Any]:
    """The entries that say what is simulated."""
    return {**_named(case), "changes": {key: _plain(value) for key, value in case.changes.items()}}


def _named(case: Scenario) -> dict[str, Any]:
    """The same but for the changes."""
    own, then = _fixed(case), shipped(case)
    same = isinstance(case.scene, str) and then is not None and own == _fixed(then)
    return {"scenario": case.name, **({} if same else own)}


def _fixed(case: Scenario) -> dict[str, Any]:
    """What of a scenario is no key."""
    return {
        "summary": case.summary,
        **({"scene": case.scene} if isinstance(case.scene, str) else {"model": os.path.abspath(case.scene)}),
        "body": case.body,
        "support": case.support,
        "contact": _points(case.contact),
        "as_modelled": not case.chosen,
        "about": case.about,
    }


def _points(contact: Any) -> Any:
    return contact if isinstance(contact, str) else np.asarray(contact).tolist()


def _plain(value: Any) -> Any:
    value = spelled(value)
    return int(value) if isinstance(value, np.integer) else value if isinstance(value, _PLAIN) else str(value)
