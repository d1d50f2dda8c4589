"""What was found before, each as an input that stays: kind -> name -> files that replace those of a right input.

An input whose files are None is made of its name by `fuzz.py` (pipes, links, empty options).
"""

from __future__ import annotations

import json

from rtds_host.diagnosis.predict import DIAGNOSIS_SCHEMAS


def _diagnosis(**content) -> bytes:
    return json.dumps({"schema": DIAGNOSIS_SCHEMAS[0], **content}).encode()


_COULOMB = {"id": "coulomb_friction", "side": "both", "parameters": {"torque_nm": 0.05}}
_HEAD = b"t,v_cmd_l,v_cmd_r,w_l\n"

FINDINGS: dict[str, dict[str, bytes]] = {
    "log": {
        "value of 1e308": _HEAD + b"0,1,1,0\n0.01,1,1,1e308\n0.02,1,1,0\n",
        "time of 1e308": _HEAD + b"0,1,1,0\n1e308,1,1,0\n",
        "digits of another script": _HEAD + "0,1,1,0\n0.01,1,1,\u0663\n".encode(),
        "underscore in a number": _HEAD + b"0,1,1,0\n0.01,1,1,1_0\n",
        "cut in the last row": _HEAD + b"0,1,1,0\n0.01,1,1,1\n0.02,1",
        "null byte": _HEAD + b"0,1,1,0\n0.01,1,1,\x00\n",
        "quote that does not end": _HEAD + b'0,1,1,0\n0.01,1,1,"1\n0.02,1,1,1\n',
        "time that stands still": _HEAD + b"0,1,1,0\n0.01,1,1,0\n0.01,1,1,0\n",
        "time that goes back in a cut row": _HEAD + b"0,1,1,0.25\n0.01,1,1,0.25\n0.02,1,1,0.25\n0.01,1,1,0.2",
        "cut in the last cell": _HEAD + b"0,1,1,0.25\n0.01,1,1,0.25\n0.02,1,1,0.25\n0.03,1,1,0.2",
        "nothing": b"",
    },
    "robot": {
        "value of 1e308": b'schema = "rtds-robot/1"\n[motor]\nresistance_ohm = 1e308\n',
        "integer beyond a double": b'schema = "rtds-robot/1"\n[motor]\nresistance_ohm = 1' + b"0" * 400 + b"\n",
        "integer beyond Python": b"x = " + b"9" * 5000 + b"\n",
        "tables without end": b"a = " + b"[" * 5000 + b"\n",
        "both body and axis": b'schema = "rtds-robot/1"\n[chassis]\n[axis]\n',
        "a name in another type": b'schema = "rtds-robot/1"\nname = 3\n[motor]\n',
    },
    "run.json": {
        "lists without end": b"[" * 100000,
        "integer beyond a double": b'{"schema": "rtds-run/1", "payload_kg": 1' + b"0" * 400 + b"}",
        "half a character": b'{"schema": "rtds-run/1", "scenario": "\\ud800"}',
        "a list": b"[1]",
        "nan": b'{"schema": "rtds-run/1", "payload_kg": NaN}',
    },
    "diagnosis": {
        "without effects": _diagnosis(),
        "effects null": _diagnosis(effects=None),
        "an effect twice": _diagnosis(effects=[_COULOMB, _COULOMB]),
        "an effect on both sides and on one": _diagnosis(effects=[_COULOMB, {**_COULOMB, "side": "left"}]),
        "a body without mass": _diagnosis(
            effects=[{"id": "payload_error", "side": "both", "parameters": {"mass_kg": -3.0}}]
        ),
        "a centre of mass beyond its inertia": _diagnosis(
            effects=[{"id": "com_offset", "side": "both", "parameters": {"x_m": 0.0, "y_m": 0.15}}]
        ),
        "a byte order mark": b"\xef\xbb\xbf" + _diagnosis(effects=[_COULOMB]),
        "a list for an id": _diagnosis(effects=[{**_COULOMB, "id": ["coulomb_friction"]}]),
    },
    "table": {
        "nothing": b"",
        "only a head": b"time_ms,u_l,u_r,n_l,n_r,c_l\n",
        "null bytes": b"\x00" * 100,
        "digits of another script": b"time_ms,u_l,u_r,n_l,n_r,c_l\n"
        + "".join(f"{10 * k},1000,1000,\u0663,0,0\n" for k in range(50)).encode(),
        "a field without end": b"time_ms,u_l,u_r,n_l,n_r,c_l\n" + b"1" * 200_000,
    },
    "mapping": {
        "no delimiter": b'schema = "rtds-mapping/1"\nname = "m"\nrobot = "burger"\n[table]\ndelimiter = ""\n',
        "two delimiters": b'schema = "rtds-mapping/1"\nname = "m"\nrobot = "burger"\n[table]\ndelimiter = ",,"\n',
        "a quote as delimiter": b'schema = "rtds-mapping/1"\nname = "m"\n[table]\ndelimiter = \'"\'\n',
        "a line end as delimiter": b'schema = "rtds-mapping/1"\nname = "m"\n[table]\ndelimiter = "\\n"\n',
        "itself as base": b'schema = "rtds-mapping/1"\nname = "m"\nbase = "mapping.toml"\n',
    },
}
PLACES = ("a pipe", "a device", "a link to itself", "a folder", "nothing")
