"""Long work in chunks: a folder that keeps the finished ones, and executors that make the others. Read `folder` first.

A chunk depends on a recipe and its number only, so that any worker can make it, and none has to be made twice.

folder      the recipe and the finished chunks on disk
execution   chunks through any `concurrent.futures.Executor`: processes of this machine, a dask cluster
"""
