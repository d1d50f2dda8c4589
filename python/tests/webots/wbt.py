"""A small reader of Webots' world files, strict about the nodes and fields that this project writes.

Nodes, fields and kinds are those of Webots' reference manual (R2023b).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

TOKEN = re.compile(r'\s+|,|#[^\n]*|"(?:[^"\\]|\\.)*"|[{}\[\]]|[^\s{}\[\],"#]+')
COUNTS = {"Float": 1, "Int32": 1, "Bool": 1, "String": 1, "Vec2f": 2, "Vec3f": 3, "Color": 3, "Rotation": 4}
POSE = {"translation": "SFVec3f", "rotation": "SFRotation", "children": "MFNode"}
SOLID = {
    **POSE,
    "name": "SFString",
    "contactMaterial": "SFString",
    "boundingObject": "SFNode",
    "physics": "SFNode",
    "locked": "SFBool",
}
NODES: dict[str, dict[str, str]] = {
    "WorldInfo": {
        "title": "SFString",
        "info": "MFString",
        "gravity": "SFFloat",
        "CFM": "SFFloat",
        "ERP": "SFFloat",
        "basicTimeStep": "SFFloat",
        "FPS": "SFFloat",
        "physicsDisableTime": "SFFloat",
        "physicsDisableLinearThreshold": "SFFloat",
        "physicsDisableAngularThreshold": "SFFloat",
        "contactProperties": "MFNode",
    },
    "ContactProperties": {
        "material1": "SFString",
        "material2": "SFString",
        "coulombFriction": "MFFloat",
        "bounce": "SFFloat",
        "softCFM": "SFFloat",
        "softERP": "SFFloat",
    },
    "Viewpoint": {"orientation": "SFRotation", "position": "SFVec3f", "follow": "SFString"},
    "Background": {"skyColor": "MFColor"},
    "DirectionalLight": {"direction": "SFVec3f", "intensity": "SFFloat"},
    "Solid": SOLID,
    "Robot": {
        **SOLID,
        "controller": "SFString",
        "controllerArgs": "MFString",
        "customData": "SFString",
        "supervisor": "SFBool",
        "synchronization": "SFBool",
        "selfCollision": "SFBool",
    },
    "GPS": {**SOLID, "accuracy": "SFFloat"},
    "Gyro": {**SOLID, "noise": "SFFloat"},
    "Physics": {
        "density": "SFFloat",
        "mass": "SFFloat",
        "centerOfMass": "MFVec3f",
        "inertiaMatrix": "MFVec3f",
        "damping": "SFNode",
    },
    "HingeJoint": {"jointParameters": "SFNode", "device": "MFNode", "endPoint": "SFNode"},
    "HingeJointParameters": {"axis": "SFVec3f", "anchor": "SFVec3f", "position": "SFFloat"},
    "RotationalMotor": {
        "name": "SFString",
        "maxVelocity": "SFFloat",
        "maxTorque": "SFFloat",
        "acceleration": "SFFloat",
        "sound": "SFString",
    },
    "PositionSensor": {"name": "SFString", "noise": "SFFloat", "resolution": "SFFloat"},
    "Pose": POSE,
    "Group": {"children": "MFNode"},
    "Shape": {"appearance": "SFNode", "geometry": "SFNode"},
    "PBRAppearance": {"baseColor": "SFColor", "roughness": "SFFloat", "metalness": "SFFloat"},
    "Box": {"size": "SFVec3f"},
    "Sphere": {"radius": "SFFloat"},
    "Cylinder": {"height": "SFFloat", "radius": "SFFloat"},
}


class WorldError(Exception):
    """What Webots would not load, or would warn of."""


@dataclass
class Node:
    """A node: its type, its DEF name, and what its fields hold."""

    type: str
    name: str = ""
    fields: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, key: str) -> Any:
        return self.fields[key]

    def below(self) -> list[Node]:
        """This node and all nodes in it."""
        found = [self]
        for value in self.fields.values():
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, Node):
                    found += one.below()
        return found

    def all(self, kind: str) -> list[Node]:
        """All nodes of a type in it."""
        return [node for node in self.below() if node.type == kind]


class _Reader:
    def __init__(self, text: str):
        self.tokens, at = [], 0
        while at < len(text):
            match = TOKEN.match(text, at)
            if match is None:
                raise WorldError(f"no token at {text[at : at + 20]!r}")
            at, token = match.end(), match.group()
            if not token.isspace() and token != "," and not token.startswith("#"):
                self.tokens.append(token)
        self.at = 0

    def peek(self) -> str:
        if self.at >= len(self.tokens):
            raise WorldError("the file ends within a node")
        return self.tokens[self.at]

    def take(self, wanted: str = "") -> str:
        token = self.peek()
        if wanted and token != wanted:
            raise WorldError(f"{wanted!r} is needed, not {token!r}")
        self.at += 1
        return token

    def node(self) -> Node | None:
        token, name = self.take(), ""
        if token == "NULL":
            return None
        if token == "DEF":
            name, token = self.take(), self.take()
        if token not in NODES:
            raise WorldError(f"{token}: no node that is known here")
        node = Node(token, name)
        self.take("{")
        while self.peek() != "}":
            key = self.take()
            if key not in NODES[token]:
                raise WorldError(f"{token}: has no field {key!r}")
            if key in node.fields:
                raise WorldError(f"{token}: {key} is given twice")
            node.fields[key] = self.value(NODES[token][key])
        self.take("}")
        check(node)
        return node

    def value(self, kind: str) -> Any:
        many, base = kind.startswith("MF"), kind[2:]
        if not many:
            return self.node() if base == "Node" else self.item(base)
        if self.peek() != "[":
            return [self.node() if base == "Node" else self.item(base)]
        self.take("[")
        found = []
        while self.peek() != "]":
            found.append(self.node() if base == "Node" else self.item(base))
        self.take("]")
        return found

    def item(self, base: str) -> Any:
        if base == "String":
            token = self.take()
            if not token.startswith('"'):
                raise WorldError(f"{token}: a string is needed")
            return re.sub(r"\\(.)", r"\1", token[1:-1])
        if base == "Bool":
            token = self.take()
            if token not in ("TRUE", "FALSE"):
                raise WorldError(f"{token}: TRUE or FALSE is needed")
            return token == "TRUE"
        numbers = []
        for _ in range(COUNTS[base]):
            token = self.take()
            try:
                numbers.append(float(token))
            except ValueError:
                raise WorldError(f"{token}: a number is needed") from None
            if not math.isfinite(numbers[-1]):
                raise WorldError(f"{token}: is not finite")
        return numbers[0] if len(numbers) == 1 else tuple(numbers)


def check(node: Node) -> None:
    """What the manual asks of single nodes.

    Raises
    ------
    WorldError : it does not hold.
    """
    get = node.fields.get
    for key in ("rotation", "orientation"):
        if get(key) is not None and abs(math.hypot(*node[key][:3]) - 1.0) > 1e-9:
            raise WorldError(f"{node.type}: {key} has no unit axis")
    if get("axis") is not None and abs(math.hypot(*node["axis"]) - 1.0) > 1e-9:
        raise WorldError(f"{node.type}: axis is no unit vector")
    if node.type == "Physics":
        if get("density", 1000.0) != -1.0 or not get("mass", -1.0) > 0.0:
            raise WorldError("Physics: with a mass the density must be -1")
        if len(get("inertiaMatrix", [])) not in (0, 2) or len(get("centerOfMass", [])) > 1:
            raise WorldError("Physics: an inertia matrix is two vectors, a centre of mass is one")
        moments = get("inertiaMatrix", [(1.0, 1.0, 1.0)])[0]
        if min(moments) <= 0.0 or 2.0 * max(moments) > sum(moments) * (1.0 + 1e-9):
            raise WorldError("Physics: no body has these moments of inertia")
    if get("physics") is not None and get("boundingObject") is None:
        raise WorldError(f"{node.type}: physics without a bounding object")
    if node.type == "HingeJoint" and node["jointParameters"]["anchor"] != node["endPoint"]["translation"]:
        raise WorldError("HingeJoint: the wheel does not sit at its anchor")
    if node.type == "Robot":
        devices = [one["name"] for kind in DEVICES for one in node.all(kind)]
        if len(set(devices)) != len(devices):
            raise WorldError("Robot: two devices of one name")


DEVICES = ("RotationalMotor", "PositionSensor", "GPS", "Gyro")


def read_world(text: str) -> list[Node]:
    """The nodes of a world file.

    Raises
    ------
    WorldError : no world file, unbalanced, an unknown node or field, a value of another kind.
    """
    if not re.match(r"#VRML_SIM R20\d\d[ab]\S* utf8\n", text):
        raise WorldError("the first line does not name a release of Webots")
    reader, nodes = _Reader(text), []
    while reader.at < len(reader.tokens):
        nodes.append(reader.node())
    kinds = [node.type for node in nodes if node is not None]
    if kinds[:2] != ["WorldInfo", "Viewpoint"] or kinds.count("WorldInfo") != 1:
        raise WorldError("a world begins with WorldInfo and Viewpoint")
    return nodes


def robot_of(nodes: list[Node]) -> Node:
    """The one robot of a world."""
    (robot,) = (node for node in nodes if node.type == "Robot")
    return robot
