"""The settings of linear algebra's threads, to be made before NumPy is loaded."""

BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
