"""The solver and contact settings of the shipped scenes, given to a file of the user's."""

from typing import Any

import mujoco
import numpy as np

SOLVER_OPTIONS = (  # those that say how MuJoCo solves, not what is simulated
    "integrator", "cone", "impratio", "jacobian", "solver", "iterations", "tolerance", "ls_iterations", "ls_tolerance",
    "noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance", "sdf_iterations", "sdf_initpoints",
)  # fmt: skip
FORCE_FLAGS = (  # flags that say what is simulated: they stay
    "GRAVITY", "EQUALITY", "LIMIT", "SPRING", "DAMPER", "FRICTIONLOSS", "ACTUATION", "CLAMPCTRL", "FILTERPARENT",
)  # fmt: skip


def choose(spec: mujoco.MjSpec, ours: mujoco.MjSpec, parts: list[Any]) -> dict[str, str]:
    """Give a spec the options and contact parameters of settings.xml, for the reasons given there.

    Args:
        spec: is changed.  ours: of a scene with these settings.
        parts: the geoms and pairs whose contacts they are for.

    Returns:
        What they replace, by name, in words: what it was.
    """
    replaced = {}
    for name in SOLVER_OPTIONS:
        old, new = getattr(spec.option, name), getattr(ours.option, name)
        if old != new:
            replaced[name] = _word(name, old)
            setattr(spec.option, name, new)
    for field, kind, kept in (("disableflags", "mjDSBL", FORCE_FLAGS), ("enableflags", "mjENBL", ("OVERRIDE",))):
        kinds = getattr(mujoco, "mjtDisableBit" if kind == "mjDSBL" else "mjtEnableBit")
        keep = sum(int(getattr(kinds, f"{kind}_{flag}")) for flag in kept)
        old = int(getattr(spec.option, field))
        names = [
            name for name, flag in kinds.__members__.items() if old & ~keep & int(flag) and name.startswith(f"{kind}_")
        ]
        if names:
            replaced[field] = ", ".join(flag.removeprefix(f"{kind}_").lower() for flag in names)
        setattr(spec.option, field, old & keep)
    spec.option.impratio *= _anisotropy(spec, parts)
    contact = {"solimp": ours.default.geom.solimp, "condim": 3, "margin": 0.0, "gap": 0.0}
    for name, new in contact.items():
        olds = {tuple(np.round(np.atleast_1d(getattr(part, name)), 9).tolist()) for part in parts}
        if olds != {tuple(np.atleast_1d(new).tolist())}:
            replaced[name] = " and ".join(", ".join(f"{x:g}" for x in old) for old in sorted(olds))
        for part in parts:
            setattr(part, name, new)
    for pair in parts:
        if isinstance(pair, mujoco.MjsPair) and np.any(pair.solreffriction):
            replaced["solreffriction"] = ", ".join(f"{x:g}" for x in pair.solreffriction[:2])
            pair.solreffriction = np.zeros_like(pair.solreffriction)  # as solref
    solrefs = {tuple(np.asarray(part.solref)[:2].tolist()) for part in parts}
    replaced["solref"] = " and ".join(", ".join(f"{x:g}" for x in old) for old in sorted(solrefs))
    spec.option.o_solimp, spec.option.o_margin = ours.default.geom.solimp, 0.0
    return replaced


def _word(name: str, value: Any) -> str:
    """An option's value as MJCF has it."""
    kinds = {"integrator": "mjtIntegrator", "cone": "mjtCone", "jacobian": "mjtJacobian", "solver": "mjtSolver"}
    if name not in kinds:
        return f"{value:g}"
    return str(getattr(mujoco, kinds[name])(int(value)).name.split("_")[1].lower())


def _anisotropy(spec: mujoco.MjSpec, parts: list[Any]) -> float:
    """How many times softer than the first tangent the softer one is: MuJoCo divides by the friction's square."""
    frictions = [part.friction[:2] for part in parts if isinstance(part, mujoco.MjsPair)]
    if spec.option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        frictions.append(spec.option.o_friction[:2])
    return max((float(both[0] / max(np.min(both), 1e-5)) ** 2 for both in frictions), default=1.0)
