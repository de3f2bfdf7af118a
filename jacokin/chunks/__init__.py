"""Long work in chunks: a folder of finished ones, and executors that make them.

A chunk is a pure function of a recipe and its number, so that it can be made anywhere and by anybody, and once only.

folder      the recipe and the finished chunks on disk
keeping     who writes finished chunks into it
execution   chunks through any `concurrent.futures.Executor`
processes   worker processes on this machine
cluster     the executor of a dask cluster
"""
