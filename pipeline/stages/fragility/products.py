"""Names of the fits' products, for who reads them without fitting."""

FILE = "fragility.nc"
TABLE = "fragility.csv"
