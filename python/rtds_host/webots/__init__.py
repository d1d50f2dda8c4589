"""The paper's robot in Webots: worlds, a project folder, and the controller by which the motors turn the wheels."""
