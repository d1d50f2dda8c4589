"""USD attributes as JSON, for a script that sets them in Isaac Sim: by prim, under the names of UsdPhysics and
PhysxSchema.

Joints: PhysxJointAxisAPI of the instance `angular` (docs.omniverse.nvidia.com, Physx Joint Schema), whose angles are
degrees. What no attribute holds is under "rtds", in SI, for the script that feeds commands and reads sensors.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict

from rtds_host.export.figures import SIDES, Figures
from rtds_host.export.forms import written_forms
from rtds_host.export.joints import drive
from rtds_host.robot.urdf import base_inertia

SCHEMA = "rtds-usd/1"


def _joint(figures: Figures, k: int) -> dict[str, float | list[float] | str]:
    side, body = figures.sides[k], figures.body
    joint = drive(figures, side)
    axis = "physxJointAxis:angular:"
    return {
        "type": "PhysicsRevoluteJoint",
        "physics:axis": "Y",
        "physics:localPos0": [0.0, (0.5 - k) * body.track_width_m, side.radius_m],
        "drive:angular:physics:maxForce": joint.effort,
        f"{axis}maxJointVelocity": math.degrees(joint.speed),
        f"{axis}armature": side.rotor_kg_m2,
        f"{axis}staticFrictionEffort": side.dry_nm + side.stribeck_nm,
        f"{axis}dynamicFrictionEffort": side.dry_nm,
        f"{axis}viscousFrictionCoefficient": math.radians(side.viscous_nm_s_per_rad),
    }


def write(figures: Figures, comment: str) -> str:
    """The robot as JSON; the lines of `comment` stand under "notes"."""
    body = figures.body
    base = base_inertia(body)
    spin = body.wheel_inertia_kg_m2
    prims: dict[str, dict] = {
        "/robot/base": {
            "type": "Xform",
            "physics:mass": base.mass_kg,
            "physics:centerOfMass": list(base.com_m),
            "physics:diagonalInertia": list(base.inertia_kg_m2),
        }
    }
    actuators, sensors = {}, {}
    for k, name in enumerate(SIDES):
        side = figures.sides[k]
        joint = drive(figures, side)
        prims[f"/robot/wheel_{name}"] = {
            "type": "Sphere",
            "radius": side.radius_m,
            "physics:mass": body.wheel_mass_kg,
            "physics:diagonalInertia": [spin / 2, spin, spin / 2],
        }
        prims[f"/robot/joints/wheel_{name}"] = _joint(figures, k)
        actuators[f"wheel_{name}"] = {
            "torque_nm_per_v": joint.torque_per_volt,
            "back_emf_nm_s_per_rad": joint.braking,
            "limit_v": figures.limit_v(side),
            "deadzone_v": side.deadzone_v,
            "pwm_curve": side.pwm_curve,
            "drop_v": side.drop_v,
            "drop_knee_a": side.drop_knee_a,
            "resistance_ohm": side.resistance_ohm,
            "command_gain": side.command_gain,
        }
        sensors[f"wheel_{name}"] = {
            "speed_gain": side.speed_gain,
            "speed_filter_s": side.speed_filter_s,
            "speed_delay_s": side.speed_delay_s,
            "current_gain": side.current_gain,
            "current_bias_a": side.current_bias_a,
        }
    fed = {
        "supply_v": figures.supply_v,
        "source_resistance_ohm": figures.source_resistance_ohm,
        "decline_v_per_s": figures.decline_v_per_s,
        "command_delay_s": figures.command_delay_s,
        **({"servo": asdict(figures.loop)} if figures.loop else {}),
        **actuators,
    }
    read = {
        "delay_s": figures.measurement_delay_s,
        "gyro_gain": figures.gyro_gain,
        "gyro_bias_rad_s": figures.gyro_bias_rad_s,
        "noise": figures.noise,
        **sensors,
    }
    curves = written_forms(figures)
    others: dict = {"actuators": fed, "sensors": read, "world": {"slope_extra_rad": figures.slope_extra_rad}}
    content = {
        "schema": SCHEMA,
        "name": figures.name,
        "notes": comment.splitlines(),
        "prims": prims,
        "rtds": others | ({"forms": curves} if curves else {}),
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"
