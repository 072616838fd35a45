"""How frames are brought together: one alone, each with its surface, or all on a shared one."""
