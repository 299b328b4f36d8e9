"""A run as tables for pandas, polars and spreadsheets: the declared columns, Arrow tables, and files of them."""
