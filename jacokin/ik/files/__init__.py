"""Files of target poses and of answers. Read `formats` first.

formats                               which format a file has
targets                               rows of numbers as targets; the other columns, which are carried through
csv_files, npz_files, parquet_files   the formats
"""
