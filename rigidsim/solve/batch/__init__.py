"""Many members of a sweep side by side, in the lanes of one compiled integrator."""
