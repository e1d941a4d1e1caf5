"""Episodes: what an arm did, step by step, and files of them. NumPy only."""

from s2c2a.episodes.episode import Episode
from s2c2a.episodes.file import EpisodeWriter, load_episodes, save_episodes
