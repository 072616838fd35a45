"""The one way into files: what a library is given has been looked at before."""
