using Nep;
using Nep.Unity;
using UnityEngine;

/// <summary>Publishes the picture of a camera as JPEG images.</summary>
[RequireComponent(typeof(Camera))]
public sealed class CameraPublisher : MonoBehaviour
{
    [SerializeField] private NepConnection connection;
    [SerializeField] private string topic = "unity/camera";
    [SerializeField] private int width = 640;
    [SerializeField] private int height = 480;
    [SerializeField] private float rateHz = 10.0f;

    private Camera _camera;
    private Publisher _publisher;
    private RenderTexture _target;
    private Texture2D _picture;
    private float _nextTime;

    private void Start()
    {
        _camera = GetComponent<Camera>();
        _publisher = connection.Node.CreatePublisher(topic, "image");
        _target = new RenderTexture(width, height, 24);
        _picture = new Texture2D(width, height, TextureFormat.RGB24, false);
    }

    private void LateUpdate()
    {
        if (Time.unscaledTime < _nextTime || _publisher.SubscriberCount == 0)
        {
            return;
        }
        _nextTime = Time.unscaledTime + 1.0f / rateHz;
        RenderTexture shown = _camera.targetTexture;
        RenderTexture active = RenderTexture.active;
        _camera.targetTexture = _target;
        _camera.Render();
        RenderTexture.active = _target;
        _picture.ReadPixels(new Rect(0, 0, width, height), 0, 0);
        _camera.targetTexture = shown;
        RenderTexture.active = active;
        _publisher.PublishImage(_picture.EncodeToJPG(75));
    }

    private void OnDestroy()
    {
        Destroy(_target);
        Destroy(_picture);
    }
}
