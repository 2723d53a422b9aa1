"""The blind benchmark: records of an independent simulator, diagnosed and scored.

``python -m tests.blind`` draws, diagnoses and prints; ``tests.drives`` makes the records, ``plan``
says which, ``work`` diagnoses one, ``limits`` says what could be reached on it, ``score`` and
``front`` count and ``page`` prints.
"""
