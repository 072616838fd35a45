"""The ``mitsuba-endo`` command, one file a subcommand.

Modules here import typer and nothing heavy at the top: help must not wait for a compiler to load.
"""
