"""Inputs as other people bring them, each with what it should come to."""
