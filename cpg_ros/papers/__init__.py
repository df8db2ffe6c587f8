"""Published quantities of the three papers, each beside what our own numerics give for it."""
