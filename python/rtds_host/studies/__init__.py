"""Studies whose tables the pages show; no other folder needs them."""
