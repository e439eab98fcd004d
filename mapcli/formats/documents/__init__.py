"""Files besides maps and logs.

json_document        head of all JSON documents   pose_trace   mapcli.pose-trace
json_schema          what is in them, from schemas/
exploration_trace    mapcli.exploration-trace     coverage_curve   CSV
similarity_table     table as JSON, CSV, Markdown and text
evaluation           mapcli.evaluation
trajectory_text      TUM, KITTI, g2o, CSV         load_trajectory   of any format
relations            relative poses between two times
perception_reader, perception_writer, perception_fields   perceptions in YAML and JSON
world                polygons and points          waypoints   paths to drive
"""
