"""Surfaces S: vertices that slide along fixed lines, one number each."""

import importlib
import pkgutil

# A surface registers itself when its file is imported: a new file need not be named here.
for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
