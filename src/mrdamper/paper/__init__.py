"""The paper, claim by claim and figure by figure, beside what the demo's virtual rig gives."""
