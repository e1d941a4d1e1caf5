"""Episodes: recordings of an arm, step by step, and their files. NumPy only."""

from s2c2a.episodes.episode import Episode
from s2c2a.episodes.file import EpisodeWriter, load_episodes, save_episodes
