"""Which core answers: the torque balance where LUGRECTL_CORE is "new"."""

from __future__ import annotations

import os

NEW = os.environ.get("LUGRECTL_CORE") == "new"
