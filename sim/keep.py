"""What is kept of the worlds of a run: a policy, which bounds the memory that many worlds take."""

KEEP = {  # with what it means
    "all": "every array of every step",
    "reduced": "the measures and some 200 samples of each world",
    "measures": "the measures of each world",
}
