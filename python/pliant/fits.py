"""Rows of tables of fits."""

from .errors import RunError


def fitted(fit, *data, **options):
    """Columns for a row: the fields of the dataclass that fit(*data, **options) returns, and the dataclass itself as `fit`. Data
    that cannot be fitted (RunError) give `fit` = None and the reason as `note`."""
    try:
        result = fit(*data, **options)
    except RunError as error:
        return {"note": str(error), "fit": None}
    return vars(result) | {"fit": result}
