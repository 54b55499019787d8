"""Colours shared by recordings and pictures of the scene, as red, green and blue from 0 to 255."""

Colour = tuple[int, int, int]

GREEN, LIME, TEAL = (60, 190, 90), (170, 220, 90), (60, 200, 200)  # applied wrench: all or F_u, F_v, M
MINT, BLUE, VIOLET = (60, 240, 190), (90, 140, 250), (190, 120, 240)  # and of the six in space the others
ORANGE, YELLOW = (255, 150, 40), (250, 215, 90)  # predicted contact force: all or f_n, f_t
RED, PINK = (225, 60, 70), (250, 150, 170)  # measured, likewise
PURPLE, GREY, WHITE = (165, 130, 235), (170, 170, 170), (235, 235, 235)  # planned cone; the world's, weight; the rest
BLOCK, EDGES, TABLE, DARK = (70, 105, 145), (150, 185, 225), (120, 112, 100), (24, 26, 30)
GLASS = 60  # opacity, from 0 to 255, of the body in space and of the friction cones
