"""`rtds doctor`: what is installed, what is missing, how to get it."""

from __future__ import annotations

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def doctor(as_json: AsJson = False) -> None:
    """Say what is installed, what is missing, what needs it and how to get it; status 1 if the program cannot work."""
    from rtds_host.start.doctor import as_json as content
    from rtds_host.start.doctor import findings

    found = findings()
    if as_json:
        answer(content(found))
    else:
        width = max(len(one.name) for one in found)
        for one in found:
            state = one.found if one.found else "missing"
            print(f"{'ok' if one.found else '--':2}  {one.name:{width}}  {state}: {one.serves}")
            if not one.found:
                print(f"    {'':{width}}  to get it: {one.get}")
    if any(one.needed and not one.found for one in found):
        raise typer.Exit(1)
