"""What happens at boundaries of natural steps: one class each, applied in the order of one list, which
``rigidsim.solve.assembly`` makes.
"""
