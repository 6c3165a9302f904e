data=
{
 "config": {
  "root_COR_file": "p.cor",
  "root_OBS_file": "o.obs",
  "coord_cov_file": "c.csv",
  "files_unit": 1,
  "local_center": [
   100,
   100,
   0
  ],
  "center_latitude": 48.8,
  "refraction": 0.12,
  "use_proj": false,
  "use_ellips_height": true,
  "compute_type": 0,
  "internal_constraints": false,
  "max_iterations": 50
 }
}