using System.ComponentModel;

namespace Nep
{
    /// <summary>Sensor messages with the names of the original library 0.0.0.5 and the fields of ROS 1.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public static class NepSensorMsgs
    {
        /// <summary>Same as <c>time</c>.</summary>
        public sealed class Time
        {
            public int secs;
            public int nsecs;
        }

        /// <summary>Same as <c>std_msgs/Header</c>.</summary>
        public sealed class Header
        {
            public uint seq;
            public Time stamp = new Time();
            public string frame_id = "";
        }

        /// <summary>Same as <c>sensor_msgs/Imu</c>.</summary>
        public sealed class Imu
        {
            public Header header = new Header();
            public NepGeometryMsgs.NepQuaternion orientation = new NepGeometryMsgs.NepQuaternion();
            public double[] orientation_covariance = new double[9];
            public NepGeometryMsgs.NepVector3 angular_velocity = new NepGeometryMsgs.NepVector3();
            public double[] angular_velocity_covariance = new double[9];
            public NepGeometryMsgs.NepVector3 linear_acceleration = new NepGeometryMsgs.NepVector3();
            public double[] linear_acceleration_covariance = new double[9];
        }

        /// <summary>Same as <c>sensor_msgs/JointState</c>.</summary>
        public sealed class JointState
        {
            public Header header = new Header();
            public string[] name = new string[0];
            public double[] position = new double[0];
            public double[] velocity = new double[0];
            public double[] effort = new double[0];
        }

        /// <summary>Same as <c>sensor_msgs/ChannelFloat32</c>.</summary>
        public sealed class ChannelFloat32
        {
            public string name = "";
            public float[] values = new float[0];
        }

        /// <summary>Same as <c>sensor_msgs/PointCloud</c>.</summary>
        public sealed class PointCloud
        {
            public Header header = new Header();
            public NepGeometryMsgs.NepPoint32[] points = new NepGeometryMsgs.NepPoint32[0];
            public ChannelFloat32[] channels = new ChannelFloat32[0];
        }

        /// <summary>Same as <c>sensor_msgs/RegionOfInterest</c>.</summary>
        public sealed class RegionOfInterest
        {
            public uint x_offset;
            public uint y_offset;
            public uint height;
            public uint width;
            public bool do_rectify;
        }

        /// <summary>Same as <c>sensor_msgs/CameraInfo</c>.</summary>
        public sealed class CameraInfo
        {
            public Header header = new Header();
            public uint height;
            public uint width;
            public string distortion_model = "";
            public double[] D = new double[0];
            public double[] K = new double[9];
            public double[] R = new double[9];
            public double[] P = new double[12];
            public uint binning_x;
            public uint binning_y;
            public RegionOfInterest roi = new RegionOfInterest();
        }

        /// <summary>Same as <c>sensor_msgs/LaserScan</c>.</summary>
        public sealed class LaserScan
        {
            public Header header = new Header();
            public float angle_min;
            public float angle_max;
            public float angle_increment;
            public float time_increment;
            public float scan_time;
            public float range_min;
            public float range_max;
            public float[] ranges = new float[0];
            public float[] intensities = new float[0];
        }

        /// <summary>Same as <c>sensor_msgs/Range</c>.</summary>
        public sealed class Range
        {
            public Header header = new Header();
            public byte radiation_type;
            public float field_of_view;
            public float min_range;
            public float max_range;
            public float range;
        }

        /// <summary>Same as <c>sensor_msgs/Temperature</c>.</summary>
        public sealed class Temperature
        {
            public Header header = new Header();
            public double temperature;
            public double variance;
        }

        /// <summary>Same as <c>sensor_msgs/Illuminance</c>.</summary>
        public sealed class Illuminance
        {
            public Header header = new Header();
            public double illuminance;
            public double variance;
        }
    }
}
