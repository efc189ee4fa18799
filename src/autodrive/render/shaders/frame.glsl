    vec4 sun_direction;         // towards the sun
    vec4 sun_color;             // irradiance of a surface that faces it
    vec4 zenith, horizon, floor_glow;  // irradiance from above, from the side, from below
    vec4 exposure;              // of light, of what glows, -, -
    mat4 sun_from_map;
    vec4 still_scale, still_offset;    // where in_sun lies in the shadow map of all that stands still
    vec4 caster_offset[16];     // the same for each vehicle's own tile of the other shadow map
    vec4 caster_tile[16];       // tile's corner, its size, whether there is one
    vec4 caster_place[16];      // x, y of the vehicle's middle, cosine and sine of its yaw
    vec4 caster_half;           // half length, half width of a vehicle, scale of its tile, scale of its depth
    vec4 lamp_place[48];        // position, range
    vec4 lamp_aim[48];          // direction, cosine of the outer cone
    vec4 lamp_color[48];        // intensity [cd], 1 / (cosine of the inner cone - of the outer)
    vec4 beam_up[8];            // of a headlight: up, and how sharply it ends above (0: not at all)
    mat4 beam_from_map[8];      // of a headlight that casts shadows
