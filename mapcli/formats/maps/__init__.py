"""Grid maps: `load` and `save` choose the format, one module per format reads and writes it.

text         .txt                     yaml_map    .yaml: map_server pairs, cells inside
pgm, png     images                   map_image   pixels and the modes trinary, scale, raw
dialects     grey <-> percent, as Nav2 and ROS 1 do it
image_cells  image -> cells, with warnings        losses   what does not survive being written
"""
