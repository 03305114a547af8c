using Nep;
using Nep.Unity;
using UnityEngine;

/// <summary>Publishes the pose of this game object in ROS coordinates at a fixed rate.</summary>
public sealed class PosePublisher : MonoBehaviour
{
    [SerializeField] private NepConnection connection;
    [SerializeField] private string topic = "unity/pose";
    [SerializeField] private float rateHz = 20.0f;

    private Publisher _publisher;
    private float _nextTime;

    private void Start()
    {
        _publisher = connection.Node.CreatePublisher(topic, "geometry_msgs/Pose");
    }

    private void Update()
    {
        if (Time.unscaledTime < _nextTime)
        {
            return;
        }
        _nextTime = Time.unscaledTime + 1.0f / rateHz;
        Vector3 position = RosConversions.ToRos(transform.position);
        Quaternion rotation = RosConversions.ToRos(transform.rotation);
        _publisher.Publish(new
        {
            position = new { position.x, position.y, position.z },
            orientation = new { rotation.x, rotation.y, rotation.z, rotation.w },
        });
    }
}
