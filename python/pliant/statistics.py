"""The most frequent value of a column."""


def commonest(values):
    """The most frequent of a column's values, of each column's where there are several; the least where two are as frequent."""
    return values.mode().iloc[0]
