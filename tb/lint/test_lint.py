"""The strict elaborator of `make lint` takes the design and refuses what Verilator and Icarus let pass."""

import pytest
from common.runner import read_file_list

from lint import lint

EARLY = "module t(input wire a_i, output wire b_o);\n  assign b_o = c;\n  wire c;\n  assign c = a_i;\nendmodule\n"
NARROW = (
    "module u(input wire [3:0] a_i);\n  wire unused = ^a_i;\nendmodule\nmodule t(input wire [4:0] a_i);\n  u x"
    " (.a_i(a_i));\nendmodule\n"
)


def test_the_design_is_clean():
    assert lint.slang(read_file_list(lint.BOARD)) == 0


@pytest.mark.parametrize("text, says", [(EARLY, "used before its declaration"), (NARROW, "port")])
def test_what_is_refused(tmp_path, capfd, text, says):
    """A name before its declaration, a port of another width."""
    source = tmp_path / "t.v"
    source.write_text(text)
    assert lint.slang([source], top="t") == 1
    assert says in "".join(capfd.readouterr())
