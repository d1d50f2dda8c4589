"""The first files of one's own: a robot from a data sheet, a draft mapping from a recording, and what is installed."""
