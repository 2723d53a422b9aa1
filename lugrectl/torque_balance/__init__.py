"""The torque balance of a log: one motion, one regression."""
