"""Names of the products of an ensemble, for stages that read them and draw none of its figures."""

FILE = "uncertainty.nc"
