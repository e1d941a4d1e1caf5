"""Response of an arm to chirps: excitation, identification, and what models expect."""
