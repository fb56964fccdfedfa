"""Campaign consistency: does each run belong to the damper that the others were fitted to, and if not, why.

``causes`` lists what can be wrong with a run, ``effects`` measures each of them in a run, ``runs`` and
``groups`` tell which runs and groups of runs leave the others, and ``joint`` fits the law for a test
without a card.
"""
