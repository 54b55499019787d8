"""The scene of a scenario in Drake: the block of the MuJoCo model, free or in a plane, on a half-space.

In *point contact* every vertex of the block is a contact point, as in MuJoCo. In *hydroelastic contact* the block is
soft, and the force is spread over the patch in which it overlaps with the half-space.
"""

from itertools import product
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import quaternion_product
from pivoting.models.frames import matrix, quaternion
from pivoting.models.rigid_body import RigidBody
from pivoting.sim.pipeline.stages import States
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import FixedOffsetFrame, PlanarJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

Array = NDArray[np.float64]
VERTEX = 1e-9  # [m] radius of the ball that stands for a vertex
STIFFNESS = 0.2  # of a vertex [mass / dt^2]; at twice as much the integrator opens contacts of light load as they turn
RIGID = 1e15  # of the table [N/m]
MODULUS = 3e8  # of the block where it is soft [Pa]; a stiffer one slides when it lands on a face
STICTION = 1e-6  # [m/s] at which friction reaches its limit, except with "sap"
DISSIPATION, RELAXATION = 10.0, 5e-4  # of Hunt and Crossley [s/m], and what "sap" takes in its place [s]
DEEPEST = 2e-3  # [m] how far above and below MuJoCo's start it may rest
PLANE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # columns x, z, -y: the turn is about -y


class DrakeWorld:
    """One world, stepped by Drake.

    Args:
        model: of MuJoCo, from which mass, size, gravity and time step are taken.
        body: the block in it, which must be a box about the body's origin.
        mu: friction of the block on its support.
        qpos: of MuJoCo, where it starts, at rest; see also `rest`.
        kind: of contact, "point" or "hydroelastic".
        approximation: "sap", "similar" or "lagged", Drake's names of its convex approximations of contact.
    """

    def __init__(
        self, model: mujoco.MjModel, body: RigidBody, mu: float, qpos: Array, *, kind: str, approximation: str
    ):
        self._body, self._dt, self._steps = body, float(model.opt.timestep), 0
        builder = DiagramBuilder()
        contact = {"contact_model": kind, "discrete_contact_approximation": approximation}
        self._plant, _ = AddMultibodyPlant(
            MultibodyPlantConfig(time_step=self._dt, stiction_tolerance=STICTION, **contact), builder
        )
        self._block = _block(self._plant, model, body, mu, kind)
        _table(self._plant, body, mu, kind)
        self._plant.mutable_gravity_field().set_gravity_vector(body.gravity)
        self._plant.Finalize()
        self._simulator = Simulator(builder.Build())
        self._context = self._plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        normal = matrix(body.table)[:, 2]
        if body.dim == 2:
            self._start = np.append(model.body_pos[body.index][[0, 2]], 0.0) + qpos
            self._up = np.append(normal[[0, 2]], 0.0)
        else:  # in Drake the quaternion comes first
            self._start, self._up = np.roll(qpos, 4), np.append(np.zeros(4), normal)
        self._begin(0.0)

    def _begin(self, lift: float) -> None:
        """Rest at the start, lifted along the table's normal [m], at time 0."""
        self._steps = 0
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositionsAndVelocities(
            self._context, np.append(self._start + lift * self._up, np.zeros(self._plant.num_velocities()))
        )
        self._simulator.Initialize()

    def rest(self, wrench: Array, load: float) -> None:
        """Start as deep in the table as the block rests there.

        Args:
            wrench: (6,) that acts on it then, as for `step`.
            load: the contacts' normal force that balances it [N].
        """
        low, high, normal = -DEEPEST, DEEPEST, matrix(self._body.table)[:, 2]
        for _ in range(60):
            middle = 0.5 * (low + high)
            self._begin(middle)
            low, high = (middle, high) if self.step(wrench) @ normal > load else (low, middle)
        self._begin(low)

    @property
    def states(self) -> States:
        """The block as it is now, as a control takes the states of one world."""
        pose = self._block.EvalPoseInWorld(self._context)
        twist = self._block.EvalSpatialVelocityInWorld(self._context)
        turned = quaternion_product(quaternion(pose.rotation().matrix()), self._body.axes)
        values = np.concatenate([pose.translation(), turned, twist.translational(), twist.rotational()])
        return States(values[None], np.zeros((1, 0)), np.zeros((1, 0)), np.zeros(1))

    def step(self, wrench: Array) -> Array:
        """Make one time step; returns the force (3,) of all contacts on the block during the step, world axes [N].

        Args:
            wrench: (6,) force and torque at the centre of mass, world axes.
        """
        applied = ExternallyAppliedSpatialForce()
        applied.body_index, applied.p_BoBq_B = self._block.index(), np.zeros(3)
        applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        self._plant.get_applied_spatial_force_input_port().FixValue(self._context, [applied])
        self._steps += 1
        self._simulator.AdvanceTo(self._steps * self._dt)
        return self._contact_force()

    def _contact_force(self) -> Array:
        found = self._plant.get_contact_results_output_port().Eval(self._context)
        force = np.zeros(3)
        for i in range(found.num_point_pair_contacts()):
            pair = found.point_pair_contact_info(i)  # whose force is that on its body B
            force += (1.0 if pair.bodyB_index() == self._block.index() else -1.0) * pair.contact_force()
        if not found.num_hydroelastic_contacts():
            return force
        geometry = self._plant.get_geometry_query_input_port().Eval(self._context).inspector()
        for i in range(found.num_hydroelastic_contacts()):
            patch = found.hydroelastic_contact_info(i)  # whose force is that on the body of its geometry M
            on = self._plant.GetBodyFromFrameId(geometry.GetFrameId(patch.contact_surface().id_M()))
            force += (1.0 if on.index() == self._block.index() else -1.0) * patch.F_Ac_W().translational()
        return force


def _block(plant: MultibodyPlant, model: mujoco.MjModel, body: RigidBody, mu: float, kind: str) -> Any:
    """The block, with its joint if it moves in the plane."""
    geom = int(model.body_geomadr[body.index])
    assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX, "the block must be a box"
    assert not np.any([body.com, model.geom_pos[geom]]), "the block must be centred on its origin"
    half, inertia = model.geom_size[geom], model.body_inertia[body.index] / body.mass
    block = plant.AddRigidBody("block", SpatialInertia(body.mass, np.zeros(3), UnitInertia(*inertia)))
    if kind == "point":
        stiffness = STIFFNESS * body.mass / plant.time_step() ** 2
        for corner in product(*zip(-half, half, strict=True)):
            at, material = RigidTransform(np.array(corner)), _material(mu, point_stiffness=stiffness)
            plant.RegisterCollisionGeometry(block, at, Sphere(VERTEX), f"vertex {corner}", material)
    else:
        soft = _material(mu)
        AddCompliantHydroelasticProperties(float(half.max()), MODULUS, soft)
        plant.RegisterCollisionGeometry(block, RigidTransform(), Box(*(2.0 * half)), "block", soft)
    if body.dim == 2:
        pose = RigidTransform(RotationMatrix(PLANE))
        ends = (
            plant.AddFrame(FixedOffsetFrame(name, frame, pose))
            for name, frame in (("plane", plant.world_frame()), ("section", block.body_frame()))
        )
        plant.AddJoint(PlanarJoint("planar", *ends))
    return block


def _table(plant: MultibodyPlant, body: RigidBody, mu: float, kind: str) -> None:
    """What the block stands on, which is as good as rigid."""
    hard = _material(mu, point_stiffness=RIGID)
    if kind == "hydroelastic":
        AddRigidHydroelasticProperties(hard)
    pose = RigidTransform(RotationMatrix(matrix(body.table)), body.origin)
    plant.RegisterCollisionGeometry(plant.world_body(), pose, HalfSpace(), "table", hard)


def _material(mu: float, **more: float) -> ProximityProperties:
    """Friction mu, the same while it sticks and while it slides."""
    out = ProximityProperties()
    AddContactMaterial(properties=out, dissipation=DISSIPATION, friction=CoulombFriction(mu, mu), **more)
    out.AddProperty("material", "relaxation_time", RELAXATION)
    return out
