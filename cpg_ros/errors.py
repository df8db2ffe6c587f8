"""The errors of the package: what is wrong with what it was given, in words for whoever gave it.

Whatever else is raised, a ValueError of numpy or one for arrays of a wrong shape, is a mistake in
the program that calls: nothing here catches it, so that it is never reported as a user's.
"""


class CpgError(ValueError):
    """What was asked for cannot be done; the message says what and why, in one line.

    Its kinds are in the files whose functions raise them.
    """


class InputError(CpgError):
    """A name, a number or data that cannot be used; the message says which, and what can be."""
