"""The run that would tell: a manoeuvre for a robot and a floor, as a table, csv and a ROS 2 script."""
