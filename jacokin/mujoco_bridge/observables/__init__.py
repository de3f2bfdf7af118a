"""What is measured in a simulation, and when it is reported. Read `observable` first.

observable   `Observable`: how a quantity is read, and its options
updater      `Updater`: observations at control rate, with delays and buffers
"""
