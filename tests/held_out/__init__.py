"""A second rig, by another hand: logs of servo drives with friction, from the physics alone."""
