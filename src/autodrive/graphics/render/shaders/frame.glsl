    vec4 sun_direction;         // towards the sun
    vec4 sun_color;             // irradiance of a surface that faces it
    vec4 zenith, horizon, floor_glow;  // irradiance from above, from the horizon, from below; horizon.w: dusk, floor_glow.w: snow cover
    vec4 exposure;              // for reflected light, for emitted light; extinction of the air, wetness of the ground
    vec4 sun_place;             // towards the sun or moon that is seen, drift of the clouds
    vec4 dawn;                  // glow of the sky below the sun, share of clouds
    vec4 extent;                // least and greatest x, y of what was placed
    mat4 sun_from_map;
    vec4 still_scale, still_offset;    // from in_sun to the static shadow map; offset of in_sun from the surface
    vec4 caster_offset[16];     // the same for the tile of each vehicle
    vec4 caster_tile[16];       // corner of the tile; half length and half width of the vehicle, 0: no vehicle
    vec4 caster_place[16];      // x, y of the vehicle's centre, cosine and sine of its yaw
    vec4 tile_scale;            // size of a tile, size of a texel, from in_sun to the place and the depth in a tile
    vec4 lamp_place[48];        // position, range
    vec4 lamp_aim[48];          // direction, cosine of the outer cone
    vec4 lamp_color[48];        // intensity [cd], 1 / (cosine of the inner cone - of the outer)
    vec4 beam_up[8];            // of a headlight: up, and sharpness of the upper edge (0: no edge)
    mat4 beam_from_map[8];      // shadow map from map axes, of a headlight that casts shadows
