"""Studies whose tables the pages show; no other room needs them."""
