"""Before NumPy is loaded: its threads cost more on small matrices than they give."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
